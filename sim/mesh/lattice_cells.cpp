#include "sim/mesh/lattice_cells.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <ranges>
#include <set>

#include "sim/parallel.h"

namespace tetpbd {
namespace {

constexpr std::size_t samples = 32, most_samples = 256;  // of a cell near the surface; of one that may be split

// The faces of a box around the body are between points of the lattice, so that flat sides do not meet whole layers.
LatticeGrid make_grid(const Bounds& box, double h) {
  const glm::dvec3 origin = box.low - h * glm::dvec3(1.37, 1.43, 1.31);
  return {h, origin, glm::ivec3(glm::ceil((box.high - origin) / h) + 2.0) * 2 + 1};
}

// Calls visit(cell) for the twelve tets around an odd point, a quarter of the ring around the axis to each neighbour
// ahead: each tet of the lattice once in all.
void for_each_cell(const LatticeGrid& grid, const glm::ivec3& at, auto&& visit) {
  constexpr std::array<std::array<int, 2>, 5> ring{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, -1}}};
  for (int a = 0; a < 3; ++a) {
    glm::ivec3 ahead = at;
    ahead[a] += 2;
    if (ahead[a] >= grid.size[a]) continue;
    const auto corner = [&](std::size_t k) {
      glm::ivec3 p = at;
      p[a] += 1, p[(a + 1) % 3] += ring[k][0], p[(a + 2) % 3] += ring[k][1];
      return grid.number(p);
    };
    for (std::size_t k = 0; k < 4; ++k) visit(Cell{grid.number(at), grid.number(ahead), corner(k), corner(k + 1)});
  }
}

// Barycentric coordinates, spread evenly; the same in every cell and with every library.
std::vector<glm::dvec4> sample_weights() {
  std::mt19937 random(5);
  std::vector<glm::dvec4> weights(most_samples);
  for (glm::dvec4& w : weights) {
    for (int k = 0; k < 4; ++k) w[k] = -std::log((double(random()) + 0.5) / 4294967296.0);
    w /= w.x + w.y + w.z + w.w;
  }
  return weights;
}
glm::dvec3 blend(const std::array<glm::dvec3, 4>& x, const glm::dvec4& w) {
  return w[0] * x[0] + w[1] * x[1] + w[2] * x[2] + w[3] * x[3];
}
glm::dvec3 middle(const std::array<glm::dvec3, 4>& x) { return blend(x, glm::dvec4(0.25)); }
double reach(const std::array<glm::dvec3, 4>& x) {
  double squared = 0;
  for (const glm::dvec3& p : x) squared = std::max(squared, glm::dot(p - middle(x), p - middle(x)));
  return std::sqrt(squared);
}

}  // namespace

std::vector<char> outer_vertices(const TetMesh& mesh) {
  std::vector<char> outer(mesh.positions.size(), 0);
  for (const Triangle& t : mesh.surface)
    for (const std::uint32_t v : t) outer[v] = 1;
  return outer;
}

LatticeCells::LatticeCells(const Solid& inside, const Bounds& box, double h)
    : solid(inside), grid(make_grid(box, h)), weights(sample_weights()) {}

// What is inside of a cell near the surface, by which samples see each other.
std::vector<Piece> LatticeCells::split(const Cell& cell, std::uint32_t number) const {
  const std::array<glm::dvec3, 4> x = corners(cell);
  const double here = solid.winding(middle(x));
  std::vector<Site> sites;
  DisjointSets groups(most_samples);
  std::size_t count = 0, looked = 0;  // of groups, of samples
  for (; looked < samples || (count > 1 && looked < most_samples); ++looked) {
    const glm::dvec3 p = blend(x, weights[looked]);
    const double there = solid.winding_at(p, middle(x), here);
    if (!(there > inside_winding)) continue;
    const auto i = std::uint32_t(sites.size());
    sites.push_back({p, there}), ++count;
    for (std::uint32_t j = 0; j < i; ++j)
      if (groups.root(i) != groups.root(j) && solid.sees(p, there, sites[j].at)) groups.join(i, j), --count;
  }
  std::map<std::uint32_t, Piece> found;  // by root
  for (std::uint32_t i = 0; i < sites.size(); ++i) {
    Piece& piece = found[groups.root(i)];
    piece.fill += 1.0f / float(looked);
    piece.sites.push_back(sites[i]);
  }
  // Crumbs are what samples saw too little of.
  if (found.size() > 1) std::erase_if(found, [](const auto& group) { return group.second.fill < 0.03f; });
  std::vector<Piece> result;
  for (auto& [root, piece] : found) {
    piece.cell = number, piece.whole = false, piece.shared = found.size() > 1;
    result.push_back(std::move(piece));
  }
  return result;
}

void LatticeCells::find(const std::function<void(double)>& watch) {
  struct Slab {
    std::vector<Cell> cells;
    std::vector<Piece> pieces;
  };
  std::vector<Slab> slabs(std::size_t(grid.size.z / 2));
  const auto find_in = [&](std::size_t s) {
    Slab& slab = slabs[s];
    glm::ivec3 at(0, 0, 2 * int(s) + 1);
    for (at.y = 1; at.y < grid.size.y; at.y += 2)
      for (at.x = 1; at.x < grid.size.x; at.x += 2) {
        const glm::dvec3 p = grid.place(at);
        const double away = 1.25 * grid.h;  // beyond the tets' reach from p, a length of h
        const bool far = solid.nearest(p, away).distance >= away;
        const double around = far ? solid.winding(p) : 0;
        if (far && !(around > inside_winding)) continue;
        for_each_cell(grid, at, [&](const Cell& cell) {
          const auto number = std::uint32_t(slab.cells.size());
          const std::array<glm::dvec3, 4> x = corners(cell);
          std::vector<Piece> found;
          if (far || solid.nearest(middle(x), reach(x)).distance >= reach(x)) {
            const double winding = far ? around : solid.winding(middle(x));
            if (winding > inside_winding) found.push_back({number, true, false, 1, {{middle(x), winding}}, {}});
          } else {
            found = split(cell, number);
          }
          if (found.empty()) return;
          slab.cells.push_back(cell);
          std::ranges::move(found, std::back_inserter(slab.pieces));
        });
      }
  };
  constexpr std::size_t batch = 16;
  for (std::size_t first = 0; first < slabs.size(); first += batch) {
    watch(double(first) / double(slabs.size()));
    parallel_for(std::min(batch, slabs.size() - first), 1, [&](std::size_t s) { find_in(first + s); });
  }
  for (Slab& slab : slabs) {
    for (Piece& piece : slab.pieces) {
      piece.corners = corners(slab.cells[piece.cell]);
      piece.cell += std::uint32_t(cells.size());
    }
    std::ranges::move(slab.pieces, std::back_inserter(pieces));
    cells.insert(cells.end(), slab.cells.begin(), slab.cells.end());
  }
}

bool LatticeCells::joined(const Piece& a, const Piece& b) const {
  if (a.whole && b.whole) return true;
  for (const Site& s : a.sites)
    for (const Site& t : b.sites)
      if (solid.sees(s.at, s.winding, t.at)) return true;
  return false;
}

// Pieces on the two sides of a face share its corners where one sees the other. Tets that meet in an edge or a vertex
// alone do not: they would be hinges.
void LatticeCells::join() {
  std::vector<std::uint32_t> first_piece(cells.size() + 1, 0);
  for (const Piece& piece : pieces) ++first_piece[piece.cell + 1];
  std::partial_sum(first_piece.begin(), first_piece.end(), first_piece.begin());
  struct Face {
    std::array<std::uint64_t, 3> corners;
    std::uint32_t cell;
    auto operator<=>(const Face&) const = default;
  };
  std::vector<Face> faces(4 * cells.size());
  parallel_for(cells.size(), [&](std::size_t c) {
    for (std::size_t f = 0; f < 4; ++f) {
      Face& face = faces[4 * c + f];
      for (std::size_t k = 0; k < 3; ++k) face.corners[k] = cells[c][tet_faces[f][k]];
      std::ranges::sort(face.corners), face.cell = std::uint32_t(c);
    }
  });
  parallel_sort(std::span(faces));
  std::vector<std::vector<std::array<std::uint32_t, 2>>> joints(faces.size());
  parallel_for(faces.size() - 1, 256, [&](std::size_t f) {
    if (faces[f].corners != faces[f + 1].corners) return;
    const std::uint32_t a = faces[f].cell, b = faces[f + 1].cell;
    for (std::uint32_t i = first_piece[a]; i < first_piece[a + 1]; ++i)
      for (std::uint32_t j = first_piece[b]; j < first_piece[b + 1]; ++j)
        if (joined(pieces[i], pieces[j])) joints[f].push_back({i, j});
  });
  nodes = DisjointSets(4 * pieces.size()), bodies = DisjointSets(pieces.size());
  const auto corner_of = [&](std::uint32_t piece, std::uint64_t point) {
    const Cell& cell = cells[pieces[piece].cell];
    return 4 * piece + std::uint32_t(std::ranges::find(cell, point) - cell.begin());
  };
  for (std::size_t f = 0; f < joints.size(); ++f)
    for (const auto& [i, j] : joints[f]) {
      bodies.join(i, j);
      for (const std::uint64_t point : faces[f].corners) nodes.join(corner_of(i, point), corner_of(j, point));
    }
}

// Takes off tets that the body hardly fills and that have ones behind them which it fills well: they would be crushed
// between it and what it meets. Tets that then meet in an edge or a vertex alone part.
void LatticeCells::peel(TetMesh& mesh) {
  struct Face {
    Triangle corners;  // sorted
    std::uint32_t tet;
    auto operator<=>(const Face&) const = default;
  };
  std::vector<Face> faces;
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
    for (const auto& [a, b, c] : tet_faces) {
      faces.push_back({{mesh.tets[t][a], mesh.tets[t][b], mesh.tets[t][c]}, t});
      std::ranges::sort(faces.back().corners);
    }
  parallel_sort(std::span(faces));
  const std::vector<char> outer = outer_vertices(mesh);
  const auto flat = [&](std::uint32_t t) {  // where the surface meets a plane, all its corners may
    return std::ranges::all_of(mesh.tets[t], [&](std::uint32_t v) { return outer[v] != 0; });
  };
  std::vector<float> behind(pieces.size(), 0), deep(pieces.size(), 0);  // fills of neighbours; of those not flat
  const auto each_pair = [&](const auto& visit) {
    for (std::size_t f = 0; f + 1 < faces.size(); ++f)
      if (faces[f].corners == faces[f + 1].corners) visit(faces[f], faces[f + 1].tet);
  };
  each_pair([&](const Face& face, std::uint32_t other) {
    for (const auto& [t, u] : {std::pair(face.tet, other), std::pair(other, face.tet)}) {
      behind[t] = std::max(behind[t], mesh.fill[u]);
      if (!flat(u)) deep[t] = std::max(deep[t], mesh.fill[u]);
    }
  });
  const auto spare = [&](std::uint32_t t) {
    const float fill = mesh.fill[t];
    return (fill < 0.3f && behind[t] > 0.6f) || (fill < 0.1f && behind[t] > 0.3f) ||
           (fill < 0.6f && deep[t] > 0.6f && flat(t));
  };
  nodes = DisjointSets(4 * pieces.size()), bodies = DisjointSets(pieces.size());
  for (std::uint32_t i = 0; i < pieces.size(); ++i) {
    if (spare(i)) pieces[i].sites.clear();
    pieces[i].fill = mesh.fill[i];
    for (std::size_t k = 0; k < 4; ++k) pieces[i].corners[k] = mesh.positions[mesh.tets[i][k]];
  }
  const auto corner_of = [&](std::uint32_t tet, std::uint32_t vertex) {
    return 4 * tet + std::uint32_t(std::ranges::find(mesh.tets[tet], vertex) - mesh.tets[tet].begin());
  };
  each_pair([&](const Face& face, std::uint32_t other) {
    if (pieces[face.tet].sites.empty() || pieces[other].sites.empty()) return;
    bodies.join(face.tet, other);
    for (const std::uint32_t v : face.corners) nodes.join(corner_of(face.tet, v), corner_of(other, v));
  });
}

void LatticeCells::number_tets(TetMesh& mesh) {
  mesh = {};
  std::vector<std::uint32_t> numbers(nodes.parent.size(), ~0u);
  for (std::uint32_t i = 0; i < pieces.size(); ++i) {
    Tet tet{};
    for (std::uint32_t k = 0; k < 4; ++k) {
      std::uint32_t& number = numbers[nodes.root(4 * i + k)];
      if (number == ~0u) number = std::uint32_t(mesh.positions.size()), mesh.positions.push_back(pieces[i].corners[k]);
      tet[k] = number;
    }
    mesh.tets.push_back(tet);
    mesh.fill.push_back(pieces[i].fill);
  }
}

// Of each patch of the surface, the largest body that is near it: crumbs would fall by themselves. Returns how many
// bodies are left, and the share of the volume that is not.
std::size_t LatticeCells::keep_parts(const std::vector<std::uint32_t>& patches, TetMesh& mesh, double& left_out) {
  std::map<std::uint32_t, double> volumes;                 // by root
  std::set<std::pair<std::uint32_t, std::uint32_t>> near;  // patch, root
  std::vector<std::uint32_t> patch(pieces.size(), ~0u);
  parallel_for(pieces.size(), 256, [&](std::size_t i) {
    if (!pieces[i].whole && !pieces[i].sites.empty()) patch[i] = patches[solid.nearest(pieces[i].sites[0].at).triangle];
  });
  double all = 0, kept = 0;
  for (std::uint32_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i].sites.empty()) continue;
    volumes[bodies.root(i)] += pieces[i].fill, all += pieces[i].fill;
    if (patch[i] != ~0u) near.insert({patch[i], bodies.root(i)});
  }
  std::map<std::uint32_t, std::pair<double, std::uint32_t>> largest;  // by patch
  for (const auto& [p, root] : near) largest[p] = std::max(largest[p], {volumes[root], root});
  std::set<std::uint32_t> wanted;
  for (const auto& [p, best] : largest) wanted.insert(best.second);
  std::vector<Piece> left;
  std::vector<std::uint32_t> old;
  std::map<std::array<std::uint32_t, 5>, std::uint32_t> same;  // cell and corners: samples may have missed a way round
  for (std::uint32_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i].sites.empty() || !wanted.contains(bodies.root(i))) continue;
    std::array<std::uint32_t, 5> key{pieces[i].cell};
    for (std::uint32_t k = 0; k < 4; ++k) key[k + 1] = nodes.root(4 * i + k);
    if (const auto [at, fresh] = same.try_emplace(key, std::uint32_t(left.size())); !fresh) {
      left[at->second].fill += pieces[i].fill;
      std::ranges::move(pieces[i].sites, std::back_inserter(left[at->second].sites));
      continue;
    }
    left.push_back(std::move(pieces[i])), old.push_back(i);
  }
  DisjointSets own(4 * left.size());
  std::map<std::uint32_t, std::uint32_t> first;  // corner of a piece that is left, by root
  for (std::uint32_t i = 0; i < left.size(); ++i) {
    kept += left[i].fill;
    for (std::uint32_t k = 0; k < 4; ++k) {
      const auto [at, fresh] = first.try_emplace(nodes.root(4 * old[i] + k), 4 * i + k);
      if (!fresh) own.join(4 * i + k, at->second);
    }
  }
  pieces = std::move(left), nodes = std::move(own);
  left_out = all > 0 ? 1 - kept / all : 0;
  number_tets(mesh);
  return wanted.size();
}

// The shares, once the tets have been fitted. A piece of a cell that has several gets what its first site sees.
void LatticeCells::fill(TetMesh& mesh) const {
  constexpr float least = 0.02f;
  parallel_for(pieces.size(), 256, [&](std::size_t i) {
    std::array<glm::dvec3, 4> x;
    for (std::size_t k = 0; k < 4; ++k) x[k] = mesh.positions[mesh.tets[i][k]];
    const Site& site = pieces[i].sites[0];
    if (!pieces[i].shared && solid.nearest(middle(x), reach(x)).distance >= reach(x)) {
      mesh.fill[i] = solid.winding(middle(x)) > inside_winding ? 1 : least;
      return;
    }
    std::size_t inside = 0;
    for (std::size_t k = 0; k < samples; ++k) {
      const glm::dvec3 p = blend(x, weights[k]);
      inside += pieces[i].shared ? solid.sees(site.at, site.winding, p)
                                 : solid.winding_at(p, site.at, site.winding) > inside_winding;
    }
    mesh.fill[i] = std::max(least, float(inside) / float(samples));
  });
}

CarriedSurface LatticeCells::carry_surface(const SurfaceMesh& given, const TetMesh& mesh, const Solid& boundary,
                                           const std::string& source) const {
  constexpr std::size_t looked_from = 4;
  const auto belongs = [&](std::size_t v, std::uint32_t tet) {
    const Piece& piece = pieces[tet];
    return piece.whole || std::ranges::any_of(piece.sites | std::views::take(looked_from), [&](const Site& site) {
             return solid.sees(site.at, site.winding, site.at + (1 - 1e-6) * (given.positions[v] - site.at));
           });
  };
  std::vector<std::uint32_t> owner(mesh.positions.size(), 0);  // a tet at each vertex
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
    for (const std::uint32_t v : mesh.tets[t]) owner[v] = t;
  return carry(given, mesh, source, belongs,
               [&](const glm::dvec3& p) { return owner[mesh.surface[boundary.nearest(p).triangle][0]]; });
}

}  // namespace tetpbd
