// The surfaces of all bodies as contact needs them: vertices, edges and triangles, and the distance that each keeps.
#pragma once

#include <array>

#include "sim/model/model.h"
#include "sim/model/settings.h"

namespace tetpbd {

struct Surfaces {
  static constexpr std::uint32_t none = ~0u;
  /// Of the mean length of the edges around a vertex. Less would ask for shorter steps, more would be seen.
  static constexpr double offset_part = 0.15;
  struct Edge {
    std::array<std::uint32_t, 2> ends, beside;  ///< beside: the third corners of its triangles; none where there is one
    std::uint32_t body;
  };
  std::vector<std::uint32_t> vertices;  ///< each once, body by body
  std::vector<Edge> edges;              ///< each once, body by body
  /// By triangle of Model::rest.surface: its edges, from each corner to the next, and its body.
  std::vector<std::array<std::uint32_t, 3>> triangle_edges;
  std::vector<std::uint32_t> triangle_bodies;
  /// By vertex of the model: its neighbours along edges, and a triangle that has it.
  std::vector<std::uint32_t> first_neighbour, neighbours;
  std::vector<std::uint32_t> own_triangle;
  std::vector<double> offsets;  ///< m, by vertex of the model: the distance that its surface keeps from others
};
/// `distance`: m, that all keep; automatic: by the edges around each vertex, of sheets at most their thickness.
Surfaces lay_out_surfaces(const Model& model, double distance = automatic);
/// m, of all edges of surfaces.
double mean_edge(const Surfaces& surfaces, const std::vector<glm::dvec3>& positions);
/// m, of the vertices of a body's surface.
double mean_offset(const Body& body, const Surfaces& surfaces);

}  // namespace tetpbd
