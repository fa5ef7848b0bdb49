#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim/mesh/surface_topology.h"

namespace tetpbd {
namespace {

// Both relative to the bounding box's diagonal d. A triangle under 1e-14 d^2 has a height in the range of
// float rounding (an equilateral one: sides of 1.5e-7 d). Volume per area and d is a thickness: a sheet of
// thickness h has about h / (3 d), a wire of thickness h about h / (4 d); rounding alone gives a double-sided
// sheet up to 1e-8.
constexpr double degenerate_area = 1e-14;
constexpr double flat_thickness = 1e-7;

std::string point(const glm::dvec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x, p.y, p.z); }

std::string counted(std::size_t count, const char* one, const char* many) {
  return fmt::format("{} {}", count, count == 1 ? one : many);
}

// The first defect stays: later ones mostly follow from it.
void note(SurfaceCheck& check, const char* defect, const std::string& place, const char* mend) {
  if (!check.defect.empty()) return;
  check.defect = defect;
  check.place = place;
  check.mend = mend;
}

glm::dvec3 centroid(const SurfaceMesh& s, const Triangle& t) {
  return (s.positions[t[0]] + s.positions[t[1]] + s.positions[t[2]]) / 3.0;
}

glm::dvec3 area_vector(const SurfaceMesh& s, const Triangle& t) {
  return glm::cross(s.positions[t[1]] - s.positions[t[0]], s.positions[t[2]] - s.positions[t[0]]) * 0.5;
}

// False when nothing else can be computed.
bool check_numbers(const SurfaceMesh& surface, SurfaceCheck& check) {
  std::size_t first_bad = 0, first_non_finite = 0, far = surface.positions.size();
  for (std::size_t t = surface.triangles.size(); t-- > 0;)
    for (const std::uint32_t v : surface.triangles[t])
      if (v >= surface.positions.size()) ++check.bad_indices, first_bad = t;
  for (std::size_t v = surface.positions.size(); v-- > 0;) {
    const glm::dvec3& p = surface.positions[v];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      ++check.non_finite, first_non_finite = v;
    else if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > largest_coordinate)
      far = v;
  }
  if (check.bad_indices > 0)
    note(check, "triangles name vertices that are not there",
         fmt::format("{}, first in triangle {}", counted(check.bad_indices, "index", "indices"), first_bad),
         "export the mesh again");
  if (check.non_finite > 0)
    note(
        check, "positions are not finite numbers",
        fmt::format("{}, first vertex {}", counted(check.non_finite, "vertex", "vertices"), first_non_finite),
        "export the mesh again");
  if (far < surface.positions.size())
    note(check, "positions are too far out",
         fmt::format("vertex {} at {}, the limit is {:g}", far, point(surface.positions[far]),
                     largest_coordinate),
         "scale the mesh");
  if (surface.triangles.size() < 4)
    note(check, "too few triangles to enclose a volume",
         counted(surface.triangles.size(), "triangle", "triangles"), "a closed surface has at least 4");
  return check.defect.empty();
}

// False when the topology cannot be built: a triangle names a vertex twice.
bool check_triangles(const SurfaceMesh& surface, double size, SurfaceCheck& check) {
  bool repeated = false;
  std::size_t first = 0;
  for (std::size_t i = surface.triangles.size(); i-- > 0;) {
    const Triangle& t = surface.triangles[i];
    const bool twice = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    repeated = repeated || twice;
    if (twice || glm::length(area_vector(surface, t)) <= degenerate_area * size * size)
      ++check.degenerate, first = i;
  }
  if (check.degenerate > 0)
    note(check, "triangles have no area",
         fmt::format("{}, first near {}", counted(check.degenerate, "triangle", "triangles"),
                     point(centroid(surface, surface.triangles[first]))),
         "remove or collapse them (in MeshLab: Remove Zero Area Faces, Merge Close Vertices)");
  return !repeated;
}

void check_duplicates(const SurfaceMesh& surface, SurfaceCheck& check) {
  std::vector<Triangle> sorted = surface.triangles;
  for (Triangle& t : sorted) std::sort(t.begin(), t.end());
  std::sort(sorted.begin(), sorted.end());
  const Triangle* first = nullptr;
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (sorted[i] == sorted[i - 1]) {
      ++check.duplicate_triangles;
      if (!first) first = &sorted[i];
    }
  if (first)
    note(check, "triangles appear more than once",
         fmt::format("{} too many, first near {}", check.duplicate_triangles,
                     point(centroid(surface, *first))),
         "remove the duplicates (a sheet with two sides is no solid)");
}

void check_edges(const SurfaceMesh& surface, const SurfaceTopology& topology, SurfaceCheck& check) {
  glm::dvec3 first_open(0), first_crowded(0), first_pinched(0);
  for (std::size_t e = topology.edge_count(); e-- > 0;) {
    const EdgeUse& use = topology.uses[topology.edges[e]];
    const glm::dvec3 middle = (surface.positions[use.low] + surface.positions[use.high]) * 0.5;
    if (topology.uses_of(e) == 1) ++check.open_edges, first_open = middle;
    if (topology.uses_of(e) > 2) ++check.non_manifold_edges, first_crowded = middle;
  }
  for (std::size_t v = topology.fans.size(); v-- > 0;)
    if (topology.fans[v] > 1) ++check.non_manifold_vertices, first_pinched = surface.positions[v];
  if (check.non_manifold_edges > 0)
    note(check, "edges have more than two triangles",
         fmt::format("{}, first near {}", counted(check.non_manifold_edges, "edge", "edges"),
                     point(first_crowded)),
         "separate or remove the extra sheets (in MeshLab: Repair Non Manifold Edges)");
  if (check.open_edges > 0)
    note(check, "surface is open",
         fmt::format("{} with one triangle only, first near {}", counted(check.open_edges, "edge", "edges"),
                     point(first_open)),
         "close its holes (in MeshLab: Close Holes)");
  if (check.non_manifold_vertices > 0)
    note(check, "parts of the surface touch in single vertices",
         fmt::format("{}, first near {}", counted(check.non_manifold_vertices, "vertex", "vertices"),
                     point(first_pinched)),
         "move the parts apart or join them (in MeshLab: Repair Non Manifold Vertices by splitting)");
}

// Turns triangles until neighbours agree: a flood from one triangle of each patch.
void orient_patches(SurfaceMesh& surface, const SurfaceTopology& topology, std::vector<char>& flipped,
                    SurfaceCheck& check) {
  struct Neighbour {
    std::uint32_t triangle = ~0u;
    bool agrees = true;
  };
  std::vector<std::array<Neighbour, 3>> neighbours(surface.triangles.size());
  for (std::size_t e = 0; e < topology.edge_count(); ++e) {
    if (topology.uses_of(e) != 2) continue;
    const EdgeUse &a = topology.uses[topology.edges[e]], &b = topology.uses[topology.edges[e] + 1];
    neighbours[a.triangle][a.side] = {b.triangle, a.forward != b.forward};
    neighbours[b.triangle][b.side] = {a.triangle, a.forward != b.forward};
  }
  std::vector<char> seen(surface.triangles.size(), 0);
  std::vector<std::uint32_t> front;
  for (std::uint32_t start = 0; start < surface.triangles.size(); ++start) {
    if (seen[start]) continue;
    seen[start] = 1;
    front.push_back(start);
    while (!front.empty()) {
      const std::uint32_t t = front.back();
      front.pop_back();
      for (const Neighbour& n : neighbours[t]) {
        if (n.triangle == ~0u || seen[n.triangle]) continue;
        seen[n.triangle] = 1;
        flipped[n.triangle] = static_cast<char>(flipped[t] ^ (n.agrees ? 0 : 1));
        front.push_back(n.triangle);
      }
    }
  }
  glm::dvec3 first(0);
  for (std::size_t e = topology.edge_count(); e-- > 0;) {
    if (topology.uses_of(e) != 2) continue;
    const EdgeUse &a = topology.uses[topology.edges[e]], &b = topology.uses[topology.edges[e] + 1];
    const bool agrees = (a.forward != b.forward) == (flipped[a.triangle] == flipped[b.triangle]);
    if (!agrees)
      ++check.misoriented_edges, first = (surface.positions[a.low] + surface.positions[a.high]) * 0.5;
  }
  if (check.misoriented_edges > 0)
    note(check, "surface has only one side",
         fmt::format("{} where it cannot be oriented, first near {}",
                     counted(check.misoriented_edges, "edge", "edges"), point(first)),
         "cut it open and close it as a solid");
}

// Turns whole patches outward and finds those without volume.
void orient_outward(SurfaceMesh& surface, const SurfaceTopology& topology, double size,
                    std::vector<char>& flipped, SurfaceCheck& check) {
  const glm::dvec3 centre = bounds(surface.positions).centre();  // small numbers: less rounding
  std::vector<double> volume(topology.patches, 0), area(topology.patches, 0);
  std::vector<std::uint32_t> member(topology.patches, 0);
  for (std::uint32_t i = 0; i < surface.triangles.size(); ++i) {
    const Triangle& t = surface.triangles[i];
    const std::uint32_t patch = topology.patch[i];
    const glm::dvec3 normal = area_vector(surface, t);
    volume[patch] += glm::dot(surface.positions[t[0]] - centre, normal) / 3 * (flipped[i] ? -1 : 1);
    area[patch] += glm::length(normal);
    member[patch] = i;
  }
  std::size_t first_flat = 0;
  for (std::size_t p = topology.patches; p-- > 0;)
    if (std::abs(volume[p]) <= flat_thickness * area[p] * size) ++check.flat_components, first_flat = p;
  if (check.flat_components > 0)
    note(check, "surface is flat",
         fmt::format("{} without volume, first near {}", counted(check.flat_components, "part", "parts"),
                     point(centroid(surface, surface.triangles[member[first_flat]]))),
         "give it thickness or remove it");
  for (std::uint32_t i = 0; i < surface.triangles.size(); ++i) {
    const bool inward = volume[topology.patch[i]] < 0;
    if ((flipped[i] != 0) == inward) continue;
    std::swap(surface.triangles[i][1], surface.triangles[i][2]);
    ++check.flipped_triangles;
  }
  for (const double v : volume) check.volume += std::abs(v);
}

}  // namespace

SurfaceCheck check_surface(SurfaceMesh& surface) {
  SurfaceCheck check;
  if (!check_numbers(surface, check)) return check;
  const double size = bounds(surface.positions).size();
  if (!check_triangles(surface, size, check)) return check;
  check_duplicates(surface, check);
  const SurfaceTopology topology = surface_topology(surface.triangles, surface.positions.size());
  check.components = static_cast<int>(topology.patches);
  check.euler_characteristic = static_cast<int>(topology.vertices) - static_cast<int>(topology.edge_count()) +
                               static_cast<int>(surface.triangles.size());
  check_edges(surface, topology, check);
  std::vector<char> flipped(surface.triangles.size(), 0);
  orient_patches(surface, topology, flipped, check);
  if (check.misoriented_edges == 0) orient_outward(surface, topology, size, flipped, check);
  return check;
}

}  // namespace tetpbd
