// Obstacles: surfaces to be drawn, and how far they reach.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "render/target.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Renderer;
struct Frame;

/// Of all obstacles in their own coordinates, made again when one is another.
struct ObstacleSurfaces {
  std::vector<Obstacle> made_of;
  std::vector<int> first;  ///< corner of each obstacle; one more at the end
  Buffer corners;          ///< ObstacleCorner, three a triangle
  VertexArray array;
};

/// Of `box` and the obstacles at that time that have an extent, as far as these are within `reach` of it.
Bounds with_obstacles(const Bounds& box, const Model& model, double time, double reach);
/// Whether there are others than half spaces.
bool has_surfaces(const Frame& frame);
/// The frame's ground and half spaces, n.x = w; the ground first.
std::vector<glm::vec4> find_planes(const Frame& frame);
/// To the image or, with `shadow`, to the map.
void draw_obstacles(Renderer& renderer, const Frame& frame, bool shadow);

}  // namespace tetpbd
