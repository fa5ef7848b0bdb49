// Draws obstacles, and finds how far they reach.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "render/target.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Renderer;
struct Frame;

/// The surfaces of all obstacles in their own coordinates.
struct ObstacleSurfaces {
  std::vector<Obstacle> made_of;
  std::vector<int> first;  ///< corner of each obstacle; one more at the end
  Buffer corners;          ///< ObstacleCorner, three a triangle
  VertexArray array;
};

/// The bounds of `box` and of obstacles of finite extent at a time (s), as far as these are within `reach` (m) of it.
Bounds with_obstacles(const Bounds& box, const Model& model, double time, double reach);
/// Whether there are obstacles other than half spaces.
bool has_surfaces(const Frame& frame);
/// The frame's ground, if any, and then its half spaces, as planes n.x = w.
std::vector<glm::vec4> find_planes(const Frame& frame);
/// Draws to the image or, with `shadow`, to the shadow map.
void draw_obstacles(Renderer& renderer, const Frame& frame, bool shadow);

}  // namespace tetpbd
