// Triangles of obstacles' surfaces, used by pictures alone.
#pragma once

#include "sim/contact/obstacle_kinds.h"

namespace tetpbd {

using Corners = std::vector<ObstacleCorner>;

/// The Minkowski sum of a ball of radius `round`, a box of half extents `half` and a disk of radius `disk` about the y
/// axis: boxes and cylinders have slightly rounded edges, which catch the light.
Corners rounded(const glm::vec3& half, float disk, float round);
/// With smooth normals across edges where triangles meet at less than 40 degrees.
Corners smoothed(const SurfaceMesh& surface);
/// The heights with walls around them; a mesh's own surface. None before the scene's files are read.
Corners height_triangles(const Obstacle& obstacle);
Corners mesh_triangles(const Obstacle& obstacle);

}  // namespace tetpbd
