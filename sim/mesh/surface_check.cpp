#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/topology.h"

namespace tetpbd {
namespace {

// Both relative to the bounding box's diagonal d. A triangle under 1e-14 d^2 has a height in the range of
// float rounding (an equilateral one: sides of 1.5e-7 d). Volume per area and d is a thickness: a sheet of
// thickness h has about h / (3 d), a wire of thickness h about h / (4 d); rounding alone gives a double-sided
// sheet up to 1e-8.
constexpr double degenerate_area = 1e-14;
constexpr double flat_thickness = 1e-7;

struct Defect {
  const char *name, *one, *many, *hint;
  std::size_t count = 0;
  std::string first{};
  void add(const std::string& place) {
    if (count++ == 0) first = place;
  }
  void add(const glm::dvec3& p) {
    if (count++ == 0) first = "near " + point_text(p);
  }
};

// The first defect that there is becomes the result; false when there is none.
bool note(SurfaceCheck& check, std::initializer_list<Defect> defects) {
  for (const Defect& d : defects) {
    if (d.count == 0) continue;
    check.count = d.count;
    check.defect = d.name;
    check.place = fmt::format("{} {}, first {}", d.count, d.count == 1 ? d.one : d.many, d.first);
    check.hint = d.hint;
    return true;
  }
  return false;
}

glm::dvec3 centroid(const SurfaceMesh& s, const Triangle& t) {
  return (s.positions[t[0]] + s.positions[t[1]] + s.positions[t[2]]) / 3.0;
}

glm::dvec3 area_vector(const SurfaceMesh& s, const Triangle& t) {
  return glm::cross(s.positions[t[1]] - s.positions[t[0]], s.positions[t[2]] - s.positions[t[0]]) * 0.5;
}

bool bad_numbers(const SurfaceMesh& surface, SurfaceCheck& check) {
  Defect indices{"triangles name vertices that are not there", "index", "indices", "export the mesh again"};
  Defect infinite{"positions are not finite numbers", "vertex", "vertices", "export the mesh again"};
  Defect far{"positions are too far out", "vertex beyond 1e30", "vertices beyond 1e30", "scale the mesh"};
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (const std::uint32_t v : surface.triangles[t])
      if (v >= surface.positions.size()) indices.add(fmt::format("in triangle {}", t));
  for (std::size_t v = 0; v < surface.positions.size(); ++v) {
    const glm::dvec3 size = glm::abs(surface.positions[v]);
    const double largest = size.x + size.y + size.z;  // NaN where one of them is
    if (!std::isfinite(largest)) infinite.add(fmt::format("vertex {}", v));
    if (largest > largest_coordinate) far.add(fmt::format("vertex {}", v));
  }
  return note(check, {indices, infinite, far});
}

bool bad_triangles(const SurfaceMesh& surface, double size, SurfaceCheck& check) {
  Defect degenerate{"triangles have no area", "triangle", "triangles",
                    "remove or collapse them (in MeshLab: Remove Zero Area Faces, Merge Close Vertices)"};
  Defect repeated{"triangles appear more than once", "too many", "too many",
                  "remove the duplicates (a sheet with two sides is no solid)"};
  for (const Triangle& t : surface.triangles)
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0] ||
        glm::length(area_vector(surface, t)) <= degenerate_area * size * size)
      degenerate.add(centroid(surface, t));
  std::vector<Triangle> sorted = surface.triangles;
  for (Triangle& t : sorted) std::ranges::sort(t);
  std::ranges::sort(sorted);
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (sorted[i] == sorted[i - 1]) repeated.add(centroid(surface, sorted[i]));
  return note(check, {degenerate, repeated});
}

bool bad_topology(const SurfaceMesh& surface, const SurfaceTopology& topology, SurfaceCheck& check) {
  Defect crowded{"edges have more than two triangles", "edge", "edges",
                 "separate or remove the extra sheets (in MeshLab: Repair Non Manifold Edges)"};
  Defect open{"surface is open", "edge with one triangle only", "edges with one triangle only",
              "close its holes (in MeshLab: Close Holes)"};
  Defect pinched{"parts of the surface touch in single vertices", "vertex", "vertices",
                 "move the parts apart or join them (in MeshLab: Repair Non Manifold Vertices by splitting)"};
  Defect one_sided{"surface has only one side", "edge where it cannot be oriented",
                   "edges where it cannot be oriented", "cut it open and close it as a solid"};
  const auto middle = [&](std::size_t edge) {
    const EdgeUse& use = topology.uses[topology.edges[edge]];
    return (surface.positions[use.low] + surface.positions[use.high]) * 0.5;
  };
  for (std::size_t e = 0; e < topology.edge_count(); ++e) {
    if (topology.uses_of(e) == 1) open.add(middle(e));
    if (topology.uses_of(e) > 2) crowded.add(middle(e));
  }
  for (std::size_t v = 0; v < topology.fans.size(); ++v)
    if (topology.fans[v] > 1) pinched.add(surface.positions[v]);
  for (const std::uint32_t e : topology.one_sided) one_sided.add(middle(e));
  return note(check, {crowded, open, pinched, one_sided});
}

// Turns triangles so that every patch faces outward, and finds the patches without volume.
void orient(SurfaceMesh& surface, const SurfaceTopology& topology, double size, SurfaceCheck& check) {
  const glm::dvec3 centre = bounds(surface.positions).centre();  // small numbers: less rounding
  std::vector<double> volume(topology.patches, 0), area(topology.patches, 0);
  std::vector<glm::dvec3> place(topology.patches);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const Triangle& t = surface.triangles[i];
    const std::uint32_t patch = topology.patch[i];
    const glm::dvec3 normal = area_vector(surface, t);
    volume[patch] += glm::dot(surface.positions[t[0]] - centre, normal) / 3 * (topology.turned[i] ? -1 : 1);
    area[patch] += glm::length(normal);
    place[patch] = centroid(surface, t);
  }
  Defect flat{"surface is flat", "part without volume", "parts without volume",
              "give it thickness or remove it"};
  for (std::size_t p = 0; p < topology.patches; ++p) {
    if (std::abs(volume[p]) <= flat_thickness * area[p] * size) flat.add(place[p]);
    check.volume += std::abs(volume[p]);
  }
  note(check, {flat});
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const bool inward = volume[topology.patch[i]] < 0;
    if (bool(topology.turned[i]) == inward) continue;
    std::swap(surface.triangles[i][1], surface.triangles[i][2]);
    ++check.flipped_triangles;
  }
}

}  // namespace

SurfaceCheck check_surface(SurfaceMesh& surface) {
  SurfaceCheck check;
  if (bad_numbers(surface, check)) return check;
  if (surface.triangles.size() < 4) {
    check.defect = "too few triangles to enclose a volume";
    check.place = fmt::format("{} of them", surface.triangles.size());
    check.hint = "a closed surface has at least 4";
    return check;
  }
  const double size = bounds(surface.positions).size();
  if (bad_triangles(surface, size, check)) return check;
  const SurfaceTopology topology = surface_topology(surface.triangles, surface.positions.size());
  check.components = int(topology.patches);
  check.euler_characteristic =
      int(topology.vertices) - int(topology.edge_count()) + int(surface.triangles.size());
  if (!bad_topology(surface, topology, check)) orient(surface, topology, size, check);
  return check;
}

}  // namespace tetpbd
