#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/topology.h"
#include "sim/parallel.h"

namespace tetpbd {
namespace {

// Dihedral angles between the faces opposite to corners a and b, degrees.
std::array<double, 6> dihedral_angles(const TetMesh& mesh, const Tet& tet) {
  const glm::dvec3 &a = mesh.positions[tet[0]], &b = mesh.positions[tet[1]], &c = mesh.positions[tet[2]],
                   &d = mesh.positions[tet[3]];
  const std::array<glm::dvec3, 4> normals{glm::cross(c - b, d - b), glm::cross(d - a, c - a),
                                          glm::cross(b - a, d - a), glm::cross(c - a, b - a)};
  std::array<double, 6> angles{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = i + 1; j < 4; ++j)  // atan2, not acos: exact to the last digits for slivers too
      angles[n++] =
          std::atan2(glm::length(glm::cross(normals[i], normals[j])), -glm::dot(normals[i], normals[j])) *
          180 / std::numbers::pi;
  return angles;
}

}  // namespace

MeshReport report(const TetMesh& mesh) {
  MeshReport r{};
  r.vertices = mesh.positions.size();
  r.tets = mesh.tets.size();
  r.surface_triangles = mesh.surface.size();
  r.edges = tet_edges(mesh).size();
  r.faces = (4 * r.tets + r.surface_triangles) / 2;
  r.euler_characteristic = int(r.vertices) - int(r.edges) + int(r.faces) - int(r.tets);

  const SurfaceTopology surface = surface_topology(mesh.surface, mesh.positions.size());
  r.surface_vertices = surface.vertices;
  // Where parts of the boundary touch in a vertex or an edge they are taken as separate sheets: one vertex
  // for each fan of triangles, one edge for each pair.
  int euler = int(mesh.surface.size());
  for (const std::uint32_t fans : surface.fans) euler += int(fans);
  for (std::size_t e = 0; e < surface.edge_count(); ++e) {
    r.bends += surface.uses_of(e) == 2;
    euler -= int(surface.uses_of(e) / 2);
  }
  r.genus = int(surface.patches) - euler / 2;

  DisjointSets parts(r.vertices);
  for (const Tet& tet : mesh.tets)
    for (const std::uint32_t v : tet) parts.join(tet[0], v);
  for (std::uint32_t v = 0; v < r.vertices; ++v) r.components += parts.root(v) == v;

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
