// Triangles of obstacles' surfaces, for pictures alone.
#pragma once

#include "sim/contact/obstacle_kinds.h"

namespace tetpbd {

using Corners = std::vector<ObstacleCorner>;

/// A ball of radius `round` drawn out: by `half` along the axes and by `disk` about the y axis. Edges of
/// boxes and cylinders are a little round, which is what catches the light.
Corners rounded(const glm::vec3& half, float disk, float round);
/// Round where triangles meet at less than 40 degrees.
Corners smoothed(const SurfaceMesh& surface);
/// The heights with walls around them; the surface that a mesh came with. Nothing before these are there.
Corners height_triangles(const Obstacle& obstacle);
Corners mesh_triangles(const Obstacle& obstacle);

}  // namespace tetpbd
