// Obstacles with a shape: surfaces to be drawn, and how far they reach.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "render/target.h"
#include "sim/model.h"

namespace tetpbd {

struct Renderer;
struct Frame;

/// Of all shapes in their own coordinates, made again when one is another.
struct ShapeSurfaces {
  struct Corner {
    glm::vec3 position, normal;
  };
  std::vector<double> made_of;
  std::vector<int> first;  ///< corner of each shape; one more at the end
  Buffer corners;          ///< three a triangle
  VertexArray array;
};

/// Triangles of a shape, of half spaces none.
std::vector<ShapeSurfaces::Corner> tessellated(const Obstacle& shape);
/// Of `box` and the shapes at that time, as far as these are within `reach` of it.
Bounds with_shapes(const Bounds& box, const Model& model, double time, double reach);
/// To the image or, with `shadow`, to the map.
void draw_shapes(Renderer& renderer, const Frame& frame, bool shadow);

}  // namespace tetpbd
