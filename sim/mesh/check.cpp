// Checks and repairs surfaces and reports on meshes, by which triangles share which edges.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>
#include <tuple>

#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/solid.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/parallel.h"

namespace tetpbd {
namespace {

/// One side of a triangle, from corner `side` to the next.
struct EdgeUse {
  std::uint32_t low, high;  ///< vertices, low < high
  std::uint32_t triangle, side;
  bool forward;  ///< the triangle runs from low to high
};

struct SurfaceTopology {
  std::vector<EdgeUse> uses;              ///< sorted by (low, high, triangle)
  std::vector<std::uint32_t> edges;       ///< where each edge begins in `uses`, and the size of `uses`
  std::vector<std::uint32_t> patch;       ///< of each triangle; a patch is joined by edges that two triangles share
  std::vector<char> turned;               ///< of each triangle, whether it is turned against others of its patch
  std::vector<std::uint32_t> one_sided;   ///< edges across which no choice of turns makes neighbours agree
  std::vector<std::uint32_t> fans;        ///< of each vertex, the number of fans of triangles around it
  std::size_t patches = 0, vertices = 0;  ///< `vertices`: those with a triangle
  std::size_t edge_count() const { return edges.size() - 1; }
  std::size_t use_count(std::size_t edge) const { return edges[edge + 1] - edges[edge]; }
};

// Indices must be in range and no triangle may name a vertex twice.
SurfaceTopology surface_topology(const std::vector<Triangle>& triangles, std::size_t vertex_count) {
  SurfaceTopology topology;
  auto& uses = topology.uses;
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), t, k, a < b});
    }
  std::ranges::sort(uses, {}, [](const EdgeUse& use) { return std::tuple(use.low, use.high, use.triangle); });
  for (std::uint32_t i = 0; i < uses.size(); ++i)
    if (i == 0 || uses[i].low != uses[i - 1].low || uses[i].high != uses[i - 1].high) topology.edges.push_back(i);
  topology.edges.push_back(std::uint32_t(uses.size()));

  // Each triangle is in two sets, as it is (2 t) and turned (2 t + 1). All in a set are oriented alike.
  DisjointSets orientations(triangles.size() * 2), corners(triangles.size() * 3);
  const auto corner = [&](const EdgeUse& use, std::uint32_t vertex) {
    const bool first = triangles[use.triangle][use.side] == vertex;
    return use.triangle * 3 + (first ? use.side : (use.side + 1) % 3);
  };
  for (std::uint32_t e = 0; e < topology.edge_count(); ++e) {
    if (topology.use_count(e) != 2) continue;
    const EdgeUse &a = uses[topology.edges[e]], &b = uses[topology.edges[e] + 1];
    const std::uint32_t i = 2 * a.triangle, agreeing = 2 * b.triangle + (a.forward == b.forward);
    if (orientations.root(i) == orientations.root(agreeing ^ 1)) {
      topology.one_sided.push_back(e);
    } else {
      orientations.join(i, agreeing);
      orientations.join(i ^ 1, agreeing ^ 1);
    }
    corners.join(corner(a, a.low), corner(b, a.low));
    corners.join(corner(a, a.high), corner(b, a.high));
  }
  std::vector<std::uint32_t> number(triangles.size() * 2, ~0u);  // number of a set's patch, by the set's root
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const std::uint32_t as_is = orientations.root(2 * t), turned = orientations.root(2 * t + 1);
    if (number[as_is] == ~0u) number[as_is] = number[turned] = std::uint32_t(topology.patches++);
    topology.patch.push_back(number[as_is]);
    topology.turned.push_back(as_is > turned);
  }
  topology.fans.assign(vertex_count, 0);
  for (std::uint32_t c = 0; c < triangles.size() * 3; ++c)
    if (corners.root(c) == c) ++topology.fans[triangles[c / 3][c % 3]];
  for (const std::uint32_t fans : topology.fans) topology.vertices += fans > 0;
  return topology;
}

// Over the square of the bounding box's diagonal d: an equilateral triangle of this area has sides of 1.5e-7 d, which
// is in the range of float rounding.
constexpr double degenerate_area = 1e-14;
// Volume over area and d: a sheet of thickness h has about h / (3 d), a wire h / (4 d), and a sheet with two sides in
// one place up to 1e-8 by rounding alone.
constexpr double flat_thickness = 1e-7;

// Records how many of 0 .. count are bad, unless a defect is known already; place() says where the first is.
void find_defect(SurfaceCheck& check, const char* defect, const char* one, const char* many, const char* hint,
                 std::size_t count, const auto& is_bad, const auto& place) {
  if (!check.defect.empty()) return;
  std::string first;
  for (std::size_t i = 0; i < count; ++i)
    if (is_bad(i) && check.count++ == 0) first = place(i);
  if (check.count == 0) return;
  check.defect = defect;
  check.place = fmt::format("{} {}, first {}", check.count, check.count == 1 ? one : many, first);
  check.hint = hint;
}

std::string near(const glm::dvec3& point) { return "near " + point_text(point); }

glm::dvec3 centroid(const SurfaceMesh& s, const Triangle& t) {
  return (s.positions[t[0]] + s.positions[t[1]] + s.positions[t[2]]) / 3.0;
}

glm::dvec3 area_vector(const SurfaceMesh& s, const Triangle& t) {
  return glm::cross(s.positions[t[1]] - s.positions[t[0]], s.positions[t[2]] - s.positions[t[0]]) * 0.5;
}

bool is_flat(const SurfaceMesh& s, const Triangle& t, double size) {
  return glm::length(area_vector(s, t)) <= degenerate_area * size * size;
}

void check_triangles(const SurfaceMesh& surface, double size, SurfaceCheck& check) {
  const std::vector<Triangle>& triangles = surface.triangles;
  if (triangles.size() < 4) {
    check.defect = "too few triangles to enclose a volume";
    check.place = fmt::format("{} of them", triangles.size());
    check.hint = "a closed surface has at least 4";
    return;
  }
  std::vector<Triangle> sorted = triangles;
  for (Triangle& t : sorted) std::ranges::sort(t);
  std::ranges::sort(sorted);
  find_defect(
      check, "triangles have no area", "triangle", "triangles",
      "remove or collapse them (in MeshLab: Remove Zero Area Faces, Merge Close Vertices)", triangles.size(),
      [&](std::size_t i) { return names_vertex_twice(triangles[i]) || is_flat(surface, triangles[i], size); },
      [&](std::size_t i) { return near(centroid(surface, triangles[i])); });
  find_defect(
      check, "triangles appear more than once", "too many", "too many",
      "remove the duplicates (a sheet with two sides is no solid)", sorted.size() - 1,
      [&](std::size_t i) { return sorted[i] == sorted[i + 1]; },
      [&](std::size_t i) { return near(centroid(surface, sorted[i])); });
}

void check_edges(const SurfaceMesh& surface, const SurfaceTopology& topology, SurfaceCheck& check) {
  const auto at_edge = [&](std::size_t edge) {
    const EdgeUse& use = topology.uses[topology.edges[edge]];
    return near((surface.positions[use.low] + surface.positions[use.high]) * 0.5);
  };
  find_defect(
      check, "edges have more than two triangles", "edge", "edges",
      "separate or remove the extra sheets (in MeshLab: Repair Non Manifold Edges)", topology.edge_count(),
      [&](std::size_t e) { return topology.use_count(e) > 2; }, at_edge);
  find_defect(
      check, "surface is open", "edge with one triangle only", "edges with one triangle only",
      "close its holes (in MeshLab: Close Holes)", topology.edge_count(),
      [&](std::size_t e) { return topology.use_count(e) == 1; }, at_edge);
  find_defect(
      check, "parts of the surface touch in single vertices", "vertex", "vertices",
      "move the parts apart or join them (in MeshLab: Repair Non Manifold Vertices by splitting)", topology.fans.size(),
      [&](std::size_t v) { return topology.fans[v] > 1; }, [&](std::size_t v) { return near(surface.positions[v]); });
  find_defect(
      check, "surface has only one side", "edge where it cannot be oriented", "edges where it cannot be oriented",
      "cut it open and close it as a solid", topology.one_sided.size(), [](std::size_t) { return true; },
      [&](std::size_t i) { return at_edge(topology.one_sided[i]); });
}

std::vector<char> closed_patches(const SurfaceTopology& topology) {
  std::vector<char> closed(topology.patches, 1);
  for (std::size_t e = 0; e < topology.edge_count(); ++e)
    if (topology.use_count(e) != 2)
      for (std::uint32_t u = topology.edges[e]; u < topology.edges[e + 1]; ++u)
        closed[topology.patch[topology.uses[u].triangle]] = 0;
  return closed;
}

// How many closed patches each one is in. A patch that is only partly in another is not in it.
std::vector<int> nesting_depths(const SurfaceMesh& surface, const SurfaceTopology& topology,
                                const std::vector<char>& closed) {
  if (topology.patches < 2) return std::vector<int>(topology.patches, 0);
  struct Part {
    std::vector<Triangle> triangles;
    Bounds box{glm::dvec3(INFINITY), glm::dvec3(-INFINITY)};
  };
  constexpr std::size_t looked_at = 8;  // vertices
  std::vector<Part> parts(topology.patches);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    Part& part = parts[topology.patch[i]];
    const Triangle& t = surface.triangles[i];
    part.triangles.push_back(topology.turned[i] ? Triangle{t[0], t[2], t[1]} : t);
    for (const std::uint32_t v : t)
      part.box.low = glm::min(part.box.low, surface.positions[v]),
      part.box.high = glm::max(part.box.high, surface.positions[v]);
  }
  std::vector<int> depths(parts.size(), 0);
  for (std::size_t b = 0; b < parts.size(); ++b) {
    std::vector<std::size_t> candidates;
    for (std::size_t a = 0; a < parts.size() && closed[b]; ++a)
      if (a != b && closed[a] && glm::all(glm::greaterThan(parts[a].box.low, parts[b].box.low)) &&
          glm::all(glm::lessThan(parts[a].box.high, parts[b].box.high)))
        candidates.push_back(a);
    if (candidates.empty()) continue;
    const SurfaceMesh shell{surface.positions, parts[b].triangles};
    const Solid solid(shell);
    for (const std::size_t a : candidates) {
      bool inside = true;
      const std::vector<Triangle>& own = parts[a].triangles;
      for (std::size_t k = 0; k < own.size() && inside; k += (own.size() + looked_at - 1) / looked_at)
        inside = std::abs(solid.winding(surface.positions[own[k][0]])) > inside_winding;
      depths[a] += inside;
    }
  }
  return depths;
}

// A point in the cavity that begins at the patch's largest triangle: halfway to what is behind it.
glm::dvec3 point_in_cavity(const SurfaceMesh& surface, const SurfaceTopology& topology, std::size_t patch,
                           const Solid& solid, double size) {
  std::size_t largest = surface.triangles.size();
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    if (topology.patch[i] == patch &&
        (largest == surface.triangles.size() || glm::length(area_vector(surface, surface.triangles[i])) >
                                                    glm::length(area_vector(surface, surface.triangles[largest]))))
      largest = i;
  const Triangle& t = surface.triangles[largest];
  const glm::dvec3 out = glm::normalize(area_vector(surface, t)), from = centroid(surface, t) + 1e-9 * size * out;
  std::vector<Solid::Crossing> found;
  solid.find_crossings(from, from + size * out, found);
  return from + out * (found.empty() ? 1e-3 * size : found[0].at * size / 2);
}

// m^3, between a triangle and a point: their sum is what a closed surface encloses, wherever the point is.
double volume_from(const glm::dvec3& apex, const std::vector<glm::dvec3>& x, const Triangle& t) {
  return glm::dot(x[t[0]] - apex, glm::cross(x[t[1]] - apex, x[t[2]] - apex)) / 6;
}

struct Patch {
  double volume = 0, area = 0;     // m^3 and m^2; as its first triangle is turned
  glm::dvec3 place{0}, centre{0};  // a point of it; of its area, from which a hole counts least and numbers are small
  int depth = 0;                   // how many closed patches it is in; if odd, it bounds a cavity
  bool closed = true;
};

std::vector<Patch> measure_patches(const SurfaceMesh& surface, const SurfaceTopology& topology) {
  std::vector<Patch> patches(topology.patches);
  const std::vector<char> closed = closed_patches(topology);
  const std::vector<int> depths = nesting_depths(surface, topology, closed);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    Patch& patch = patches[topology.patch[i]];
    const double own = glm::length(area_vector(surface, surface.triangles[i]));
    patch.place = centroid(surface, surface.triangles[i]);
    patch.area += own, patch.centre += own * patch.place;
  }
  for (std::size_t p = 0; p < patches.size(); ++p)
    patches[p].centre /= patches[p].area, patches[p].depth = depths[p], patches[p].closed = closed[p] != 0;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    Patch& patch = patches[topology.patch[i]];
    patch.volume += volume_from(patch.centre, surface.positions, surface.triangles[i]) * (topology.turned[i] ? -1 : 1);
  }
  return patches;
}

bool is_cavity(const Patch& patch) { return patch.depth % 2 == 1; }

double volume_of(const std::vector<Patch>& patches) {
  double volume = 0;
  for (const Patch& patch : patches) volume += std::abs(patch.volume) * (is_cavity(patch) ? -1 : 1);
  return volume;
}

// Turns triangles so that every patch faces away from what is solid, which is inward where it bounds a cavity. One that
// is open and hardly hollow keeps its side. Returns how many were turned.
std::size_t turn_patches(SurfaceMesh& surface, const SurfaceTopology& topology, const std::vector<Patch>& patches) {
  constexpr double round_enough = 1e-3;  // volume over area^1.5
  std::size_t turned = 0;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const Patch& patch = patches[topology.patch[i]];
    const bool known = patch.closed || std::abs(patch.volume) > round_enough * std::pow(patch.area, 1.5);
    const bool turn = known && (patch.volume < 0) != is_cavity(patch);
    if (bool(topology.turned[i]) == turn) continue;
    std::swap(surface.triangles[i][1], surface.triangles[i][2]);
    ++turned;
  }
  return turned;
}

// Turns triangles outward and finds the patches without volume, and the cavities.
void orient(SurfaceMesh& surface, const SurfaceTopology& topology, double size, SurfaceCheck& check) {
  const std::vector<Patch> patches = measure_patches(surface, topology);
  check.volume = volume_of(patches);
  find_defect(
      check, "surface is flat", "part without volume", "parts without volume", "give it thickness or remove it",
      patches.size(),
      [&](std::size_t p) { return std::abs(patches[p].volume) <= flat_thickness * patches[p].area * size; },
      [&](std::size_t p) { return near(patches[p].place); });
  check.flipped_triangles = turn_patches(surface, topology, patches);
  if (std::ranges::none_of(patches, is_cavity)) return;
  const Solid solid(surface);
  for (std::size_t p = 0; p < patches.size(); ++p)
    if (is_cavity(patches[p])) check.cavities.push_back(point_in_cavity(surface, topology, p, solid, size));
}

// Dihedral angles between the faces opposite to corners a and b, degrees.
std::array<double, 6> dihedral_angles(const TetMesh& mesh, const Tet& tet) {
  const glm::dvec3 &a = mesh.positions[tet[0]], &b = mesh.positions[tet[1]], &c = mesh.positions[tet[2]],
                   &d = mesh.positions[tet[3]];
  const std::array<glm::dvec3, 4> normals{glm::cross(c - b, d - b), glm::cross(d - a, c - a), glm::cross(b - a, d - a),
                                          glm::cross(c - a, b - a)};
  std::array<double, 6> angles{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = i + 1; j < 4; ++j)  // acos would lose the last digits for slivers
      angles[n++] = std::atan2(glm::length(glm::cross(normals[i], normals[j])), -glm::dot(normals[i], normals[j])) *
                    180 / std::numbers::pi;
  return angles;
}

// A flat triangle has its corner c on its longest side a b. If it has one neighbour across that side, cuts the
// neighbour in two at c, which replaces both triangles. Whether it did.
bool flip_flat(SurfaceMesh& surface, std::size_t flat) {
  const Triangle t = surface.triangles[flat];
  const auto side = [&](std::size_t k) {
    return glm::distance(surface.positions[t[k]], surface.positions[t[(k + 1) % 3]]);
  };
  const std::size_t k = std::ranges::max({0u, 1u, 2u}, {}, side);
  const std::uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
  std::size_t other = surface.triangles.size(), count = 0;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const auto has = [&](std::uint32_t v) { return std::ranges::count(surface.triangles[i], v) > 0; };
    if (i != flat && has(a) && has(b)) other = i, ++count;
  }
  if (count != 1) return false;
  Triangle first = surface.triangles[other], second = first;
  std::ranges::replace(first, a, c), std::ranges::replace(second, b, c);
  if (std::ranges::count(first, c) > 1) return false;  // the neighbour has c as a corner already
  surface.triangles[other] = first, surface.triangles[flat] = second;
  return true;
}

}  // namespace

SurfaceCheck check_surface(SurfaceMesh& surface) {
  SurfaceCheck check = check_values(surface);
  if (check.hopeless) return check;
  const double size = bounds(surface.positions).size();
  check_triangles(surface, size, check);
  if (!check.defect.empty()) return check;
  const SurfaceTopology topology = surface_topology(surface.triangles, surface.positions.size());
  check.components = int(topology.patches);
  check.euler_characteristic = int(topology.vertices) - int(topology.edge_count()) + int(surface.triangles.size());
  check_edges(surface, topology, check);
  if (check.defect.empty()) orient(surface, topology, size, check);
  return check;
}

Outward turn_outward(const SurfaceMesh& given) {
  Outward outward{given, {}};
  SurfaceMesh& surface = outward.surface;
  repair(surface);
  const SurfaceTopology topology = surface_topology(surface.triangles, surface.positions.size());
  const std::vector<Patch> patches = measure_patches(surface, topology);
  turn_patches(surface, topology, patches);
  outward.patches = topology.patch;
  outward.closed = std::ranges::all_of(patches, &Patch::closed);
  outward.cavities = int(std::ranges::count_if(patches, is_cavity));
  outward.volume = volume_of(patches);
  return outward;
}

SurfaceCheck check_values(const SurfaceMesh& surface) {
  SurfaceCheck check;
  const auto at_vertex = [](std::size_t v) { return fmt::format("vertex {}", v); };
  // NaN where a coordinate is.
  const auto reach = [&](std::size_t v) { return glm::dot(glm::abs(surface.positions[v]), glm::dvec3(1)); };
  find_defect(
      check, "triangles name vertices that are not there", "index", "indices", "export the mesh again",
      3 * surface.triangles.size(),
      [&](std::size_t i) { return surface.triangles[i / 3][i % 3] >= surface.positions.size(); },
      [](std::size_t i) { return fmt::format("in triangle {}", i / 3); });
  find_defect(
      check, "positions are not finite numbers", "vertex", "vertices", "export the mesh again",
      surface.positions.size(), [&](std::size_t v) { return !std::isfinite(reach(v)); }, at_vertex);
  find_defect(
      check, "positions are too far out", "vertex beyond 1e30", "vertices beyond 1e30", "scale the mesh",
      surface.positions.size(), [&](std::size_t v) { return reach(v) > largest_coordinate; }, at_vertex);
  check.hopeless = !check.defect.empty();
  return check;
}

TetMesh sheet_of(SurfaceMesh surface, const std::string& source) {
  repair(surface);
  const SurfaceCheck check = check_values(surface);
  if (check.hopeless) throw Error(check.defect, check.place + " in " + source, check.hint);
  if (surface.triangles.empty()) throw Error("sheet has no area", source, "export the surface again");
  const SurfaceTopology topology = surface_topology(surface.triangles, surface.positions.size());
  std::vector<std::size_t> first(topology.patches, surface.triangles.size());  // of each patch, which the others follow
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    std::size_t& one = first[topology.patch[t]];
    one = std::min(one, t);
    if (topology.turned[t] != topology.turned[one]) std::swap(surface.triangles[t][1], surface.triangles[t][2]);
  }
  const double thickness = 1e-3 * bounds(surface.positions).size();
  return {std::move(surface.positions), {}, std::move(surface.triangles), false, thickness};
}

std::string repair(SurfaceMesh& surface) {
  if (check_values(surface).hopeless) return {};
  std::vector<std::string> done;
  const auto record = [&](std::size_t count, const char* one, const char* many) {
    if (count > 0) done.push_back(fmt::format("{} {}", count, count == 1 ? one : many));
  };
  SurfaceMesh repaired = surface;
  auto& triangles = repaired.triangles;
  const double size = bounds(surface.positions).size();
  std::size_t dropped = std::erase_if(triangles, names_vertex_twice), flipped = 0;
  const std::size_t before_welding = triangles.size();
  weld(repaired, 0);
  record(surface.positions.size() - repaired.positions.size(), "vertex merged or without a triangle",
         "vertices merged or without a triangle");
  dropped += before_welding - triangles.size();
  for (std::size_t t = 0; t < triangles.size();) {
    const bool flat = is_flat(repaired, triangles[t], size), flips = flat && flip_flat(repaired, t);
    flipped += flips, dropped += flat && !flips;
    if (flat && !flips)
      triangles.erase(triangles.begin() + std::ptrdiff_t(t));
    else
      ++t;
  }
  record(dropped, "triangle without area dropped", "triangles without area dropped");
  record(flipped, "triangle without area turned into its neighbour", "triangles without area turned into neighbours");
  std::set<Triangle> seen;
  const std::size_t repeated = std::erase_if(triangles, [&](Triangle t) {
    std::ranges::sort(t);
    return !seen.insert(t).second;
  });
  record(repeated, "repeated triangle dropped", "repeated triangles dropped");
  drop_unused_vertices(repaired.positions, triangles);
  record(check_surface(repaired).flipped_triangles, "triangle turned outward", "triangles turned outward");
  if (!done.empty()) surface = std::move(repaired);
  return fmt::format("{}", fmt::join(done, ", "));
}

double mean_edge(const TetMesh& mesh) {
  double edges = 0;
  for (const Tet& tet : mesh.tets)
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < a; ++b) edges += glm::distance(mesh.positions[tet[a]], mesh.positions[tet[b]]);
  return edges / (6 * double(mesh.tets.size()));
}

FlattestTet flattest_tet(const TetMesh& mesh) {
  FlattestTet flattest{0, INFINITY};
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    if (const double altitude = least_altitude(mesh, mesh.tets[t]); altitude < flattest.altitude)
      flattest = {t, altitude};
  flattest.quality = flattest.altitude / mean_edge(mesh);
  return flattest;
}

MeshReport report(const TetMesh& mesh) {
  MeshReport r{};
  r.vertices = mesh.positions.size();
  r.tets = mesh.tets.size();
  r.surface_triangles = mesh.surface.size();
  const Bounds box = bounds(mesh.positions);
  r.size = box.high - box.low;
  r.filled = filled_volume(mesh);
  r.edges = tet_edges(mesh).size();
  DisjointSets parts(r.vertices);
  std::vector<char> solid(r.vertices, 0);
  for (const Tet& tet : mesh.tets)
    for (const std::uint32_t v : tet) parts.join(tet[0], v), solid[v] = 1;
  std::vector<Triangle> boundary, sheets;
  for (const Triangle& t : mesh.surface) (solid[t[0]] ? boundary : sheets).push_back(t);
  for (const Triangle& t : sheets) parts.join(t[0], t[1]), parts.join(t[0], t[2]);
  for (std::uint32_t v = 0; v < r.vertices; ++v) r.components += parts.root(v) == v;
  r.faces = (4 * r.tets + boundary.size()) / 2 + sheets.size();
  r.euler_characteristic = int(r.vertices) - int(r.edges) + int(r.faces) - int(r.tets);

  const SurfaceTopology surface = surface_topology(boundary, mesh.positions.size()),
                        thin = surface_topology(sheets, mesh.positions.size());
  r.surface_vertices = surface.vertices + thin.vertices;
  for (std::size_t e = 0; e < thin.edge_count(); ++e) r.bends += thin.use_count(e) == 2;
  // Where parts of the boundary touch in a vertex or an edge they are taken as separate sheets: one vertex
  // for each fan of triangles, one edge for each pair.
  int euler = int(boundary.size());
  for (const std::uint32_t fans : surface.fans) euler += int(fans);
  for (std::size_t e = 0; e < surface.edge_count(); ++e) {
    r.bends += surface.use_count(e) == 2;
    euler -= int(surface.use_count(e) / 2);
  }
  r.genus = int(surface.patches) - euler / 2;

  // A part of the boundary that encloses less than nothing looks into a cavity.
  std::vector<double> enclosed(surface.patches, 0);
  for (std::size_t t = 0; t < boundary.size(); ++t)
    enclosed[surface.patch[t]] += volume_from(box.centre(), mesh.positions, boundary[t]);
  r.cavities = int(std::ranges::count_if(enclosed, [](double volume) { return volume < 0; }));

  if (r.tets == 0) return r;
  const FlattestTet flattest = flattest_tet(mesh);
  r.worst_altitude = flattest.altitude, r.worst_tet = flattest.tet;
  r.smallest_tet_volume = INFINITY;
  r.min_dihedral_deg = 180;
  struct Shape {
    double volume, low, high;  // m^3, degrees
  };
  std::vector<Shape> shapes(mesh.tets.size());
  parallel_for(shapes.size(), [&](std::size_t i) {
    const auto angles = dihedral_angles(mesh, mesh.tets[i]);
    const auto [low, high] = std::minmax_element(angles.begin(), angles.end());
    shapes[i] = {tet_volume(mesh, mesh.tets[i]), *low, *high};
  });
  for (const auto& [volume, low, high] : shapes) {
    r.volume += volume;
    r.smallest_tet_volume = std::min(r.smallest_tet_volume, volume);
    r.inverted += volume <= 0;
    r.min_dihedral_deg = std::min(r.min_dihedral_deg, low);
    r.max_dihedral_deg = std::max(r.max_dihedral_deg, high);
    r.mean_min_dihedral_deg += low;
    r.slivers += low < 5 || high > 175;
  }
  r.mean_tet_volume = r.volume / double(r.tets);
  r.mean_min_dihedral_deg /= double(r.tets);
  return r;
}

}  // namespace tetpbd
