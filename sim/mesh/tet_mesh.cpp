#include "sim/mesh/tet_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_access.hpp>
#include <numeric>

#include "sim/error.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/parallel.h"

namespace tetpbd {

std::array<glm::dvec3, 4> barycentric_gradients(const std::array<glm::dvec3, 4>& x) {
  const glm::dmat3 inverse = glm::inverse(glm::dmat3(x[1] - x[0], x[2] - x[0], x[3] - x[0]));
  const glm::dvec3 rows[3] = {glm::row(inverse, 0), glm::row(inverse, 1), glm::row(inverse, 2)};
  return {-(rows[0] + rows[1] + rows[2]), rows[0], rows[1], rows[2]};
}
namespace {

// A tet with |6 V| under this times its longest edge cubed has no volume, because rounding decides its sign.
constexpr double no_volume = 1e-10;

double longest_edge(const TetMesh& mesh, const Tet& tet) {
  double longest = 0;
  for (const std::uint32_t a : tet)
    for (const std::uint32_t b : tet) longest = std::max(longest, glm::distance(mesh.positions[a], mesh.positions[b]));
  return longest;
}

void check_indices(const TetMesh& mesh, const std::string& source) {
  if (mesh.tets.empty()) throw Error("mesh has no tetrahedron", source, "export it with its volume elements");
  if (mesh.positions.size() >= 0xffffffffu || mesh.tets.size() >= 0x3fffffffu)
    throw Error("mesh is too large for 32-bit indices", source, "use a coarser one");
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    Tet t = mesh.tets[i];
    std::ranges::sort(t);
    if (t[3] >= mesh.positions.size())
      throw Error(fmt::format("tet {} names vertex {} of {}", i, t[3], mesh.positions.size()), source,
                  "export the mesh again");
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[3])
      throw Error(fmt::format("tet {} names a vertex twice", i), source, "remove such elements");
  }
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const glm::dvec3 size = glm::abs(mesh.positions[v]);
    const double largest = size.x + size.y + size.z;  // NaN where a coordinate is
    if (!std::isfinite(largest))
      throw Error(fmt::format("position of vertex {} is not finite", v), source, "export the mesh again");
    if (largest > largest_coordinate)
      throw Error(fmt::format("vertex {} is at {}, further out than {:g}", v, point_text(mesh.positions[v]),
                              largest_coordinate),
                  source, "scale the mesh");
  }
}

void orient_tets(TetMesh& mesh, const std::string& source) {
  std::size_t flat = 0;
  std::string first;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    Tet& t = mesh.tets[i];
    const double volume = tet_volume(mesh, t);
    const bool is_flat = 6 * std::abs(volume) <= no_volume * std::pow(longest_edge(mesh, t), 3);
    if (is_flat && flat++ == 0) first = fmt::format("first tet {} near {}", i, point_text(mesh.positions[t[0]]));
    if (volume < 0) std::swap(t[2], t[3]);
  }
  if (flat > 0)
    throw Error("tets have no volume", fmt::format("{} of them, {} in {}", flat, first, source),
                "mesh again with quality switches (such as pYq1.85o/140) or remove them");
}

// Groups faces by their smallest vertex and sorts each group, which is four times as fast as sorting all.
void find_boundary(TetMesh& mesh, const std::string& source) {
  const auto outward = [&](std::size_t face) -> Triangle {  // tet * 4 + side
    const Tet& t = mesh.tets[face / 4];
    const auto& [a, b, c] = tet_faces[face % 4];
    return {t[a], t[b], t[c]};
  };
  const auto each = [&](std::size_t face, const auto& emit) {
    emit(std::ranges::min(outward(face)), std::uint32_t(face));
  };
  const Grouped grouped = group_by_key(4 * mesh.tets.size(), mesh.positions.size(), each);
  struct Face {
    std::pair<std::uint32_t, std::uint32_t> others;  // its two larger vertices, sorted
    std::uint32_t id;
    bool even;  // whether the outward order is an even permutation of the sorted one
  };
  std::vector<std::uint32_t> boundary;
  std::vector<Face> faces;
  DisjointSets pieces(mesh.tets.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    faces.clear();
    for (std::uint32_t i = grouped.first[v]; i < grouped.first[v + 1]; ++i) {
      const std::uint32_t id = grouped.values[i];
      Triangle f = outward(id);
      std::ranges::rotate(f, std::ranges::min_element(f));
      faces.push_back({std::minmax(f[1], f[2]), id, f[1] < f[2]});
    }
    std::ranges::sort(faces, {}, &Face::others);
    for (auto f = faces.begin(); f != faces.end();) {
      auto next = f + 1;
      while (next != faces.end() && next->others == f->others) ++next;
      // Parts of a lattice that part at a face keep it, so it may have two tets on a side.
      const bool both_sides = std::any_of(f, next, [&](const Face& other) { return other.even != f->even; });
      if (mesh.fill.empty() && (next - f > 2 || (next - f == 2 && !both_sides))) {
        const auto [one, other] = std::minmax({f->id / 4, f[1].id / 4});
        throw Error(fmt::format("tets {} and {} overlap", one, other),
                    fmt::format("near {} in {}", point_text(mesh.positions[v]), source),
                    "remove duplicate or folded elements");
      }
      for (; f != next; ++f)
        if (both_sides)
          pieces.join(f->id / 4, (next - 1)->id / 4);
        else
          boundary.push_back(f->id);
    }
  }
  std::ranges::sort(boundary);  // the order of the tets
  mesh.surface.clear();
  for (const std::uint32_t face : boundary) mesh.surface.push_back(outward(face));
  mesh.one_piece = true;
  for (std::uint32_t t = 1; t < mesh.tets.size(); ++t)
    mesh.one_piece = mesh.one_piece && pieces.root(t) == pieces.root(0);
}

}  // namespace

void finish_tets(TetMesh& mesh, const std::string& source) {
  check_indices(mesh, source);
  orient_tets(mesh, source);
  drop_unused_vertices(mesh.positions, mesh.tets);
  find_boundary(mesh, source);
}

// Kuhn's subdivision: a tet for each order of the axes in which a path leads from the cell's low corner to its high
// one. All cells share the diagonal's direction, so the faces of neighbours match.
TetMesh make_block(const glm::dvec3& size, const glm::ivec3& cells, bool mirrored) {
  TetMesh mesh;
  const glm::uvec3 nodes(cells + 1);
  const auto visit_grid = [](const glm::uvec3& counts, const auto& visit) {
    for (std::uint32_t z = 0; z < counts.z; ++z)
      for (std::uint32_t y = 0; y < counts.y; ++y)
        for (std::uint32_t x = 0; x < counts.x; ++x) visit(glm::uvec3(x, y, z));
  };
  visit_grid(nodes, [&](const glm::uvec3& at) {
    mesh.positions.push_back(size * (glm::dvec3(at) / glm::dvec3(cells) - 0.5));
  });
  constexpr std::array<std::array<int, 3>, 6> orders{
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  visit_grid(glm::uvec3(cells), [&](const glm::uvec3& at) {
    glm::uvec3 from = at, to = at + 1u;  // the ends of the diagonal that the cell's six tets share
    for (int axis = 0; axis < 3 && mirrored; ++axis)
      if (at[axis] % 2 == 1) std::swap(from[axis], to[axis]);
    const auto number = [&](const glm::uvec3& node) { return node.x + node.y * nodes.x + node.z * nodes.x * nodes.y; };
    for (const auto& [i, j, k] : orders) {
      glm::uvec3 second = from;
      second[i] = to[i];
      glm::uvec3 third = second;
      third[j] = to[j];
      mesh.tets.push_back({number(from), number(second), number(third), number(to)});
    }
  });
  finish_tets(mesh, "block");
  return mesh;
}

TetMesh make_spindle(const glm::dvec3& size, const glm::ivec3& cells, double taper, bool mirrored) {
  TetMesh mesh = make_block(size, cells, mirrored);
  for (glm::dvec3& p : mesh.positions) {
    const glm::dvec3 u = 2.0 * p / size;  // -1 to 1
    const double thin = 1 - taper * u.y * u.y;
    p.x *= thin * std::sqrt(1 - u.z * u.z / 4);
    p.z *= thin * std::sqrt(1 - u.x * u.x / 4);
  }
  finish_tets(mesh, "spindle");
  return mesh;
}

TetMesh make_sheet(const std::array<double, 2>& size, const std::array<int, 2>& cells) {
  SurfaceMesh surface;
  const auto row = std::uint32_t(cells[0] + 1);
  for (int z = 0; z <= cells[1]; ++z)
    for (int x = 0; x <= cells[0]; ++x)
      surface.positions.emplace_back(size[0] * (double(x) / cells[0] - 0.5), 0, size[1] * (double(z) / cells[1] - 0.5));
  for (std::uint32_t z = 0; z < std::uint32_t(cells[1]); ++z)
    for (std::uint32_t x = 0; x + 1 < row; ++x) {
      const std::uint32_t a = z * row + x, b = a + 1, c = a + row, d = c + 1;  // upwards: z, then x
      if ((x + z) % 2 == 0)
        surface.triangles.insert(surface.triangles.end(), {{a, c, d}, {a, d, b}});
      else
        surface.triangles.insert(surface.triangles.end(), {{a, c, b}, {b, c, d}});
    }
  return sheet_of(std::move(surface), "sheet");
}

double tet_volume(const TetMesh& mesh, const Tet& tet) {
  const glm::dvec3& origin = mesh.positions[tet[0]];
  return glm::dot(glm::cross(mesh.positions[tet[1]] - origin, mesh.positions[tet[2]] - origin),
                  mesh.positions[tet[3]] - origin) /
         6;
}

double least_altitude(const TetMesh& mesh, const Tet& tet) {
  const auto& x = mesh.positions;
  double largest = 0;
  for (const auto& [a, b, c] : tet_faces)
    largest = std::max(largest, glm::length(glm::cross(x[tet[b]] - x[tet[a]], x[tet[c]] - x[tet[a]])));
  return 6 * tet_volume(mesh, tet) / largest;
}

double mesh_volume(const TetMesh& mesh) {
  const std::vector<double> volumes = tet_volumes(mesh);
  return std::accumulate(volumes.begin(), volumes.end(), 0.0);
}

double filled_volume(const TetMesh& mesh) {
  const std::vector<double> volumes = tet_volumes(mesh);
  double sum = 0;
  for (std::size_t i = 0; i < volumes.size(); ++i) sum += fill_of(mesh, i) * volumes[i];
  return sum;
}

std::vector<double> tet_volumes(const TetMesh& mesh) {
  std::vector<double> volumes(mesh.tets.size());
  parallel_for(volumes.size(), [&](std::size_t i) { volumes[i] = tet_volume(mesh, mesh.tets[i]); });
  return volumes;
}

std::vector<double> lumped_masses(const TetMesh& mesh, double density) {
  std::vector<double> masses(mesh.positions.size(), 0);
  const std::vector<double> volumes = tet_volumes(mesh);
  for (std::size_t i = 0; i < volumes.size(); ++i) {
    const double quarter = density * volumes[i] * fill_of(mesh, i) / 4;
    for (const std::uint32_t v : mesh.tets[i]) masses[v] += quarter;
  }
  if (mesh.tets.empty())
    for (const auto& [a, b, c] : mesh.surface) {
      const auto& x = mesh.positions;
      const double third = density * mesh.thickness * glm::length(glm::cross(x[b] - x[a], x[c] - x[a])) / 6;
      masses[a] += third, masses[b] += third, masses[c] += third;
    }
  return masses;
}

std::vector<std::array<std::uint32_t, 2>> tet_edges(const TetMesh& mesh) {
  const auto each = [&](std::size_t i, const auto& emit) {
    const auto emit_edges = [&](const auto& element) {
      for (std::size_t a = 0; a < element.size(); ++a)
        for (std::size_t b = a + 1; b < element.size(); ++b)
          emit(std::min(element[a], element[b]), std::max(element[a], element[b]));
    };
    if (i < mesh.tets.size())
      emit_edges(mesh.tets[i]);
    else
      emit_edges(mesh.surface[i - mesh.tets.size()]);
  };
  Grouped others = group_by_key(mesh.tets.size() + mesh.surface.size(), mesh.positions.size(), each);
  std::vector<std::array<std::uint32_t, 2>> edges;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const auto first = others.values.begin() + others.first[v], end = others.values.begin() + others.first[v + 1];
    std::sort(first, end);
    const auto last = std::unique(first, end);
    for (auto other = first; other != last; ++other) edges.push_back({v, *other});
  }
  return edges;
}

Bounds bounds(const std::vector<glm::dvec3>& positions) {
  Bounds box{glm::dvec3(INFINITY), glm::dvec3(-INFINITY)};
  for (const glm::dvec3& p : positions) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
    box.low = glm::min(box.low, p);
    box.high = glm::max(box.high, p);
  }
  return box.low.x <= box.high.x ? box : Bounds{};
}

std::string point_text(const glm::dvec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x, p.y, p.z); }

}  // namespace tetpbd
