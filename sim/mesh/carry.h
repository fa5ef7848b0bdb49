// A fine surface that rides on coarse tets: every vertex keeps its place in one of them.
#pragma once

#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct CarriedVertex {
  std::uint32_t tet;
  glm::vec3 weights;  ///< of the tet's corners 1 to 3; corner 0 has what they leave of 1
};
struct CarriedSurface {
  std::vector<CarriedVertex> vertices;
  std::vector<Triangle> triangles;
};

/// Both in one frame. A vertex outside belongs to the nearest tet; one further out than a tenth of the mesh's
/// size throws Error naming `source`.
CarriedSurface carry(const SurfaceMesh& surface, const TetMesh& mesh, const std::string& source);
/// The mesh's own boundary, its vertices in order.
CarriedSurface carry_boundary(const TetMesh& mesh);
std::vector<glm::dvec3> carried_positions(const CarriedSurface& surface, const std::vector<Tet>& tets,
                                          const std::vector<glm::dvec3>& positions);

}  // namespace tetpbd
