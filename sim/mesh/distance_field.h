// Signed distance fields: distances from a surface on a grid, which solvers and shaders look up in place of triangles.
#pragma once

#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Values are at grid points `origin + spacing * (i, j, k)`. The surface is three cells away from the border.
struct DistanceField {
  glm::ivec3 size{0};
  glm::dvec3 origin{0};
  double spacing = 0;         ///< m
  std::vector<float> values;  ///< m, negative inside; x fastest
};

/// Whether the program was built with OpenVDB.
bool can_make_distance_fields();
/// With `voxels` cells along the longest side of the surface's bounding box. A surface that encloses nothing (open,
/// flat) counts as a sheet one cell thick. Cached. Throws Error naming `source`, also where the program was built
/// without OpenVDB.
DistanceField distance_field(const SurfaceMesh& surface, int voxels, const std::string& source = "surface");

}  // namespace tetpbd
