#include "sim/overlap.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "sim/formulas.h"
#include "sim/pairs.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

using Cell = glm::ivec3;
struct CellHash {
  std::size_t operator()(const Cell& c) const {
    return std::size_t(c.x) * 73856093u ^ std::size_t(c.y) * 19349663u ^ std::size_t(c.z) * 83492791u;
  }
};

bool is_in(const glm::dvec3& p, const Tet& tet, const std::vector<glm::dvec3>& x) {
  const glm::dvec3& origin = x[tet[0]];
  const glm::dmat3 edges(x[tet[1]] - origin, x[tet[2]] - origin, x[tet[3]] - origin);
  const double volume = glm::determinant(edges);
  if (!(volume > 0)) return false;
  const glm::dvec3 at = glm::inverse(edges) * (p - origin);
  return at.x > 0 && at.y > 0 && at.z > 0 && at.x + at.y + at.z < 1;
}

}  // namespace

Overlap overlap_of(const Model& model, const std::vector<glm::dvec3>& x, bool self) {
  const PairMesh mesh = pair_mesh(model);
  const double cell = 2 * mesh.edge, near = 2.4 * mesh.edge;
  const auto& rest = model.rest.positions;
  std::vector<Bounds> boxes;
  std::vector<double> sizes;
  for (const Body& body : model.bodies) {
    const auto first = x.begin() + std::ptrdiff_t(body.first_vertex);
    boxes.push_back(bounds({first, first + std::ptrdiff_t(body.vertices)}));
    const auto at_rest = rest.begin() + std::ptrdiff_t(body.first_vertex);
    sizes.push_back(bounds({at_rest, at_rest + std::ptrdiff_t(body.vertices)}).size());
  }
  const auto meets_another = [&](std::size_t body, const Bounds& box) {
    for (std::size_t b = 0; b < boxes.size(); ++b)
      if (b != body && glm::all(glm::lessThan(box.low, boxes[b].high)) &&
          glm::all(glm::lessThan(boxes[b].low, box.high)))
        return true;
    return self;
  };
  std::unordered_map<Cell, std::vector<std::uint32_t>, CellHash> grid;
  std::vector<std::uint32_t> body_of(model.rest.tets.size());
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b)
    for (std::size_t t = model.bodies[b].first_tet; t < model.bodies[b].first_tet + model.bodies[b].tets;
         ++t) {
      body_of[t] = b;
      const auto& [i, j, k, l] = model.rest.tets[t];
      const Bounds box = bounds({x[i], x[j], x[k], x[l]});
      if (!meets_another(b, box)) continue;
      const Cell low(glm::floor(box.low / cell)), high(glm::floor(box.high / cell));
      for (Cell c = low; c.z <= high.z; ++c.z)
        for (c.y = low.y; c.y <= high.y; ++c.y)
          for (c.x = low.x; c.x <= high.x; ++c.x) grid[c].push_back(std::uint32_t(t));
    }
  const auto depth = [&](const PairMesh::Item& item) {
    const auto found = grid.find(Cell(glm::floor(x[item.vertex] / cell)));
    if (found == grid.end()) return 0.0;
    for (const std::uint32_t t : found->second) {
      const Tet& tet = model.rest.tets[t];
      const bool own = body_of[t] == item.body;
      if (own && (!self || std::ranges::any_of(tet, [&](std::uint32_t v) {
            return glm::distance(rest[v], rest[item.vertex]) < near;
          })))
        continue;
      if (!is_in(x[item.vertex], tet, x)) continue;
      double least = 1e30;
      for (const auto& [i, j, k, body] : mesh.triangles)
        if (body == body_of[t] && !(own && glm::distance(rest[i], rest[item.vertex]) < near)) {
          const glm::dvec3 a = x[i] - x[item.vertex], b = x[j] - x[item.vertex], c = x[k] - x[item.vertex];
          const glm::dvec3 w = Formulas<double>{}.nearest_weights(a, b, c);
          least = std::min(least, glm::length(w.x * a + w.y * b + w.z * c));
        }
      return least;
    }
    return 0.0;
  };
  std::vector<double> depths(mesh.vertices.size());
  parallel_for(
      depths.size(), [&](std::size_t s) { depths[s] = depth(mesh.vertices[s]); }, 64);
  Overlap result;
  if (!depths.empty()) result.deepest = std::ranges::max(depths);
  for (std::size_t s = 0; s < depths.size(); ++s) depths[s] /= sizes[mesh.vertices[s].body];
  result.inside = std::size_t(std::ranges::count_if(depths, [](double d) { return d > 0; }));
  std::ranges::sort(depths);
  if (depths.empty()) return result;
  result.largest = depths.back();
  result.part_999 = depths[std::size_t(0.999 * double(depths.size() - 1))];
  return result;
}

Overlap largest(const Overlap& a, const Overlap& b) {
  return {std::max(a.inside, b.inside), std::max(a.largest, b.largest), std::max(a.deepest, b.deepest),
          std::max(a.part_999, b.part_999)};
}

}  // namespace tetpbd
