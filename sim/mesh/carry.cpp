#include "sim/mesh/carry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/error.h"
#include "sim/parallel.h"

namespace tetpbd {
namespace {

constexpr double reach = 0.1;         // of the mesh's size; a vertex further out belongs to another mesh
constexpr double largest_weight = 3;  // more would let a flat tet magnify every error
constexpr std::uint32_t none = ~0u;

/// Tets by the cells of a grid that their bounding boxes overlap.
struct TetGrid {
  glm::dvec3 low;
  double cell;
  glm::ivec3 size;
  Grouped tets;
  std::vector<glm::dmat3> to_weights;  ///< of each tet
  glm::ivec3 find_cell(const glm::dvec3& p) const { return glm::ivec3(glm::floor((p - low) / cell)); }
};

TetGrid make_grid(const TetMesh& mesh) {
  const Bounds box = bounds(mesh.positions);
  TetGrid grid;
  grid.low = box.low;
  grid.cell = std::max(box.size() / 200, std::cbrt(mesh_volume(mesh) / double(mesh.tets.size())));
  grid.size = glm::ivec3((box.high - box.low) / grid.cell) + 1;
  grid.tets = group_by_key(
      mesh.tets.size(), std::size_t(grid.size.x * grid.size.y * grid.size.z), [&](std::size_t t, const auto& emit) {
        glm::dvec3 low(INFINITY), high(-INFINITY);
        for (const std::uint32_t v : mesh.tets[t])
          low = glm::min(low, mesh.positions[v]), high = glm::max(high, mesh.positions[v]);
        const glm::ivec3 a = glm::max(grid.find_cell(low), 0), b = glm::min(grid.find_cell(high), grid.size - 1);
        for (int z = a.z; z <= b.z; ++z)
          for (int y = a.y; y <= b.y; ++y)
            for (int x = a.x; x <= b.x; ++x)
              emit(std::uint32_t((z * grid.size.y + y) * grid.size.x + x), std::uint32_t(t));
      });
  for (const auto& [a, b, c, d] : mesh.tets) {
    const auto& x = mesh.positions;
    grid.to_weights.push_back(glm::inverse(glm::dmat3(x[b] - x[a], x[c] - x[a], x[d] - x[a])));
  }
  return grid;
}

using Weights = std::array<double, 4>;

glm::dvec3 blend(const std::vector<glm::dvec3>& positions, const Tet& tet, const Weights& w) {
  glm::dvec3 sum(0);
  for (std::size_t k = 0; k < 4; ++k) sum += w[k] * positions[tet[k]];
  return sum;
}

double largest_magnitude(const Weights& weights) {
  double largest = 0;
  for (const double w : weights) largest = std::max(largest, std::abs(w));
  return largest;
}

// Searches cells further and further around p, until no tet in those left can be nearer.
CarriedVertex embed_vertex(const glm::dvec3& p, const TetMesh& mesh, const TetGrid& grid, double farthest,
                           const auto& belongs) {
  const glm::ivec3 middle = grid.find_cell(p);
  std::pair<double, std::uint32_t> best{INFINITY, none};
  Weights weights{};
  const auto try_tet = [&](std::uint32_t t) {
    const glm::dvec3 w = grid.to_weights[t] * (p - mesh.positions[mesh.tets[t][0]]);
    const Weights now{1 - w.x - w.y - w.z, w.x, w.y, w.z};
    Weights inside;
    double sum = 0;
    for (std::size_t k = 0; k < 4; ++k) sum += inside[k] = std::max(now[k], 0.0);
    for (double& k : inside) k /= sum;
    // The distance to a point in the tet is an upper bound of that to the tet. Large weights make flat tets come last.
    double away = std::ranges::min(now) > -1e-9 ? 0
                                                : glm::distance(p, blend(mesh.positions, mesh.tets[t], inside)) *
                                                      std::max(largest_magnitude(now), 1.0);
    if (away < std::min(best.first, grid.cell) && !belongs(t)) away += grid.cell;
    if (std::pair(away, t) < best) best = {away, t}, weights = now;
  };
  for (int r = 0; best.first > r * grid.cell && (r - 1) * grid.cell < farthest; ++r)
    for (int z = -r; z <= r; ++z)
      for (int y = -r; y <= r; ++y)
        for (int x = -r; x <= r; x += std::max(std::abs(y), std::abs(z)) == r ? 1 : std::max(2 * r, 1)) {
          const glm::ivec3 c = middle + glm::ivec3(x, y, z);
          if (glm::any(glm::lessThan(c, glm::ivec3(0))) || glm::any(glm::greaterThanEqual(c, grid.size))) continue;
          const auto key = std::size_t((c.z * grid.size.y + c.y) * grid.size.x + c.x);
          for (std::uint32_t i = grid.tets.first[key]; i < grid.tets.first[key + 1]; ++i) try_tet(grid.tets.values[i]);
        }
  if (best.second == none) return {none, glm::vec3(0)};
  const double largest = largest_magnitude(weights);
  const double kept = largest > largest_weight ? (largest_weight - 0.25) / (largest - 0.25) : 1;
  for (double& w : weights) w = 0.25 + (w - 0.25) * kept;
  const bool far = glm::distance(p, blend(mesh.positions, mesh.tets[best.second], weights)) > farthest;
  const bool out = best.first > farthest * std::max(largest, 1.0);
  return {far || out ? none : best.second, glm::vec3(weights[1], weights[2], weights[3])};
}

}  // namespace

CarriedSurface carry(const SurfaceMesh& surface, const TetMesh& mesh, const std::string& source,
                     const std::function<bool(std::size_t, std::uint32_t)>& belongs,
                     const std::function<std::uint32_t(const glm::dvec3&)>& nearest) {
  const TetGrid grid = make_grid(mesh);
  // Where anything is carried, looking on in the grid would only take long.
  const double farthest = nearest ? 2 * grid.cell : reach * bounds(mesh.positions).size();
  CarriedSurface result{std::vector<CarriedVertex>(surface.positions.size()), surface.triangles};
  parallel_for(surface.positions.size(), [&](std::size_t v) {
    result.vertices[v] = embed_vertex(surface.positions[v], mesh, grid, farthest,
                                      [&](std::uint32_t tet) { return !belongs || belongs(v, tet); });
  });
  for (std::size_t v = 0; nearest && v < result.vertices.size(); ++v) {
    CarriedVertex& vertex = result.vertices[v];
    if (vertex.tet != none) continue;
    vertex.tet = nearest(surface.positions[v]);
    vertex.weights =
        glm::vec3(grid.to_weights[vertex.tet] * (surface.positions[v] - mesh.positions[mesh.tets[vertex.tet][0]]));
  }
  const auto lost = std::ranges::find(result.vertices, none, &CarriedVertex::tet);
  if (lost == result.vertices.end()) return result;
  const auto v = std::size_t(lost - result.vertices.begin());
  throw Error("surface does not fit its tets",
              fmt::format("vertex {} at {} is more than {:.3g} m away from them, in {}", v,
                          point_text(surface.positions[v]), farthest, source),
              "export both from one place and scale, or leave \"mesh\" out; where tets are too large for a thin "
              "part, take more");
}

CarriedSurface carry_boundary(const TetMesh& mesh) {
  CarriedSurface result{std::vector<CarriedVertex>(mesh.positions.size()), mesh.surface};
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
    for (int k = 0; k < 4; ++k) result.vertices[mesh.tets[t][std::size_t(k)]] = {t, glm::vec3(k == 1, k == 2, k == 3)};
  drop_unused_vertices(result.vertices, result.triangles);
  return result;
}

std::vector<glm::dvec3> carried_positions(const CarriedSurface& surface, const std::vector<Tet>& tets,
                                          const std::vector<glm::dvec3>& positions) {
  std::vector<glm::dvec3> result(surface.vertices.size());
  parallel_for(result.size(), [&](std::size_t v) {
    const auto& [tet, w] = surface.vertices[v];
    const glm::dvec3 u(w);
    result[v] = blend(positions, tets[tet], {1 - u.x - u.y - u.z, u.x, u.y, u.z});
  });
  return result;
}

}  // namespace tetpbd
