#include "sim/contact/surfaces.h"

#include <algorithm>
#include <tuple>

#include "sim/parallel.h"

namespace tetpbd {

namespace {

struct Side {
  std::uint32_t low, high, beside, triangle, corner;
};

std::vector<Side> sort_sides(const Model& model) {
  std::vector<Side> sides;
  for (std::uint32_t t = 0; t < model.rest.surface.size(); ++t)
    for (std::uint32_t c = 0; c < 3; ++c) {
      const Triangle& corners = model.rest.surface[t];
      const std::uint32_t a = corners[c], b = corners[(c + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), corners[(c + 2) % 3], t, c});
    }
  std::ranges::sort(sides, {}, [](const Side& s) { return std::tuple(s.low, s.high, s.triangle); });
  return sides;
}

}  // namespace

Surfaces lay_out_surfaces(const Model& model, double distance) {
  Surfaces result;
  const std::size_t count = model.rest.positions.size();
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b)
    result.triangle_bodies.insert(result.triangle_bodies.end(), model.bodies[b].triangles, b);
  result.own_triangle.assign(count, Surfaces::none);
  for (std::uint32_t t = 0; t < model.rest.surface.size(); ++t)
    for (const std::uint32_t v : model.rest.surface[t])
      if (result.own_triangle[v] == Surfaces::none) result.own_triangle[v] = t;
  for (std::uint32_t v = 0; v < count; ++v)
    if (result.own_triangle[v] != Surfaces::none) result.vertices.push_back(v);
  result.triangle_edges.resize(model.rest.surface.size());
  for (const Side& side : sort_sides(model)) {
    const bool same = !result.edges.empty() && result.edges.back().ends == std::array{side.low, side.high};
    if (!same)
      result.edges.push_back(
          {{side.low, side.high}, {side.beside, Surfaces::none}, result.triangle_bodies[side.triangle]});
    else
      result.edges.back().beside[1] = side.beside;
    result.triangle_edges[side.triangle][side.corner] = std::uint32_t(result.edges.size() - 1);
  }
  const Grouped around = group_by_key(result.edges.size(), count, [&](std::size_t e, auto&& emit) {
    const auto& [a, b] = result.edges[e].ends;
    emit(a, b), emit(b, a);
  });
  result.first_neighbour = around.first, result.neighbours = around.values;
  result.offsets.assign(count, 0);
  for (const std::uint32_t v : result.vertices) {
    double length = 0;
    const std::uint32_t first = result.first_neighbour[v], end = result.first_neighbour[v + 1];
    for (std::uint32_t k = first; k < end; ++k)
      length += glm::distance(model.rest.positions[v], model.rest.positions[result.neighbours[k]]);
    const Body& body = body_at(model, v);
    result.offsets[v] = Surfaces::offset_part * length / std::max(1u, end - first);
    if (body.thickness > 0) result.offsets[v] = std::min(result.offsets[v], body.thickness);
    if (distance != automatic) result.offsets[v] = distance;
  }
  return result;
}

double mean_edge(const Surfaces& surfaces, const std::vector<glm::dvec3>& positions) {
  double sum = 0;
  for (const Surfaces::Edge& e : surfaces.edges) sum += glm::distance(positions[e.ends[0]], positions[e.ends[1]]);
  return sum / double(std::max<std::size_t>(surfaces.edges.size(), 1));
}

double mean_offset(const Body& body, const Surfaces& surfaces) {
  double sum = 0;
  long count = 0;
  for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v)
    if (surfaces.offsets[v] > 0) sum += surfaces.offsets[v], ++count;
  return count > 0 ? sum / double(count) : 0;
}

}  // namespace tetpbd
