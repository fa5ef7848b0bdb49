#include "sim/measure/overlap.h"

#include <algorithm>
#include <cmath>

#include "sim/contact/cell_grid.h"
#include "sim/contact/surfaces.h"
#include "sim/model/formulas.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

bool is_in(const glm::dvec3& p, const Tet& tet, const std::vector<glm::dvec3>& x) {
  const glm::dvec3& origin = x[tet[0]];
  const glm::dmat3 edges(x[tet[1]] - origin, x[tet[2]] - origin, x[tet[3]] - origin);
  const double volume = glm::determinant(edges);
  if (!(volume > 0)) return false;
  const glm::dvec3 at = glm::inverse(edges) * (p - origin);
  return at.x > 0 && at.y > 0 && at.z > 0 && at.x + at.y + at.z < 1;
}

}  // namespace

Overlap measure_overlap(const Model& model, const std::vector<glm::dvec3>& x, bool self) {
  const Surfaces surfaces = lay_out_surfaces(model);
  const double edge = mean_edge(surfaces, model.rest.positions);
  const double cell = 2 * edge, near = 2.4 * edge;
  const auto& rest = model.rest.positions;
  std::vector<Bounds> boxes;
  std::vector<double> sizes;
  for (const Body& body : model.bodies) {
    boxes.push_back(body_bounds(body, x));
    sizes.push_back(body_bounds(body, rest).size());
  }
  const auto may_overlap = [&](std::size_t body, const Bounds& box) {
    for (std::size_t b = 0; b < boxes.size(); ++b)
      if (b != body && !are_apart(box, boxes[b])) return true;
    return self;
  };
  const auto body_of = [&](std::uint32_t v) { return surfaces.triangle_bodies[surfaces.own_triangle[v]]; };
  CellGrid grid(cell);
  std::vector<std::uint32_t> tet_body(model.rest.tets.size());
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b)
    for (std::size_t t = model.bodies[b].first_tet; t < model.bodies[b].first_tet + model.bodies[b].tets; ++t) {
      tet_body[t] = b;
      const auto& [i, j, k, l] = model.rest.tets[t];
      const Bounds box = bounds({x[i], x[j], x[k], x[l]});
      if (may_overlap(b, box)) grid.add(box, std::uint32_t(t));
    }
  std::vector<double> depths(surfaces.vertices.size(), 0);  // in the first tet that a vertex is in
  parallel_for(depths.size(), 64, [&](std::size_t s) {
    const std::uint32_t own_vertex = surfaces.vertices[s], own_body = body_of(own_vertex);
    const auto is_near = [&](std::uint32_t v) { return glm::distance(rest[v], rest[own_vertex]) < near; };
    grid.for_each({x[own_vertex], x[own_vertex]}, [&](std::uint32_t t) {
      const Tet& tet = model.rest.tets[t];
      const bool own = tet_body[t] == own_body;
      if (depths[s] > 0 || (own && (!self || std::ranges::any_of(tet, is_near))) || !is_in(x[own_vertex], tet, x))
        return;
      double least = 1e30;
      const Body& body = model.bodies[tet_body[t]];
      for (std::size_t s = body.first_triangle; s < body.first_triangle + body.triangles; ++s)
        if (const auto& [i, j, k] = model.rest.surface[s]; !(own && is_near(i))) {
          const glm::dvec3 a = x[i] - x[own_vertex], b = x[j] - x[own_vertex], c = x[k] - x[own_vertex];
          const glm::dvec3 w = Formulas<double>{}.nearest_weights(a, b, c);
          least = std::min(least, glm::length(w.x * a + w.y * b + w.z * c));
        }
      depths[s] = least;
    });
  });
  Overlap result;
  result.crossings = find_crossings(model, x, self);
  if (depths.empty()) return result;
  result.deepest = std::ranges::max(depths);
  for (std::size_t s = 0; s < depths.size(); ++s) depths[s] /= sizes[body_of(surfaces.vertices[s])];
  result.inside = std::size_t(std::ranges::count_if(depths, [](double d) { return d > 0; }));
  std::ranges::sort(depths);
  result.largest = depths.back();
  result.part_999 = depths[std::size_t(0.999 * double(depths.size() - 1))];
  return result;
}

Overlap largest(const Overlap& a, const Overlap& b) {
  return {std::max(a.inside, b.inside), largest(a.crossings, b.crossings), std::max(a.largest, b.largest),
          std::max(a.deepest, b.deepest), std::max(a.part_999, b.part_999)};
}

}  // namespace tetpbd
