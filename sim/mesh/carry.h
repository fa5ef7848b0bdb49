// Embedded surfaces: each vertex of a fine surface keeps its place in one of the coarse tets.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct CarriedVertex {
  std::uint32_t tet;
  glm::vec3 weights;  ///< of the tet's corners 1 to 3; that of corner 0 makes the sum 1
};
struct CarriedSurface {
  std::vector<CarriedVertex> vertices;
  std::vector<Triangle> triangles;
};

/// Both meshes are in one frame. A vertex outside belongs to the nearest tet; one further out than a tenth of the
/// mesh's size throws Error naming `source`.
/// Of tets in one place, those for which belongs(vertex, tet) holds come first; nearest(p) carries what is further out.
CarriedSurface carry(const SurfaceMesh& surface, const TetMesh& mesh, const std::string& source,
                     const std::function<bool(std::size_t, std::uint32_t)>& belongs = {},
                     const std::function<std::uint32_t(const glm::dvec3&)>& nearest = {});
/// Embeds the mesh's own boundary; vertices stay in order.
CarriedSurface carry_boundary(const TetMesh& mesh);
std::vector<glm::dvec3> carried_positions(const CarriedSurface& surface, const std::vector<Tet>& tets,
                                          const std::vector<glm::dvec3>& positions);

}  // namespace tetpbd
