#include "sim/mesh/weld.h"

#define GLM_ENABLE_EXPERIMENTAL  // hash

#include <algorithm>
#include <cmath>
#include <glm/gtx/hash.hpp>
#include <unordered_map>

namespace tetpbd {

// A grid of cells eight tolerances wide: a point looks into its own cell, and into a neighbour only where it
// stands within a tolerance of the wall between them.
void weld(SurfaceMesh& surface, double tolerance) {
  const auto& positions = surface.positions;
  const Bounds box = bounds(positions);
  // A mesh far from the origin has no finer steps than its own numbers, nor would cells be whole numbers.
  const double largest = glm::length(glm::max(glm::abs(box.low), glm::abs(box.high)));
  tolerance = std::max({tolerance, largest * 1e-15, 1e-300});
  const auto cell = [&](const glm::dvec3& p) { return glm::floor((p - box.low) / (8 * tolerance)); };
  std::unordered_multimap<glm::dvec3, std::uint32_t> cells;  // the vertices kept
  cells.reserve(positions.size());
  std::vector<std::uint32_t> kept(positions.size());
  for (std::uint32_t v = 0; v < positions.size(); ++v) {
    kept[v] = v;
    const glm::dvec3& p = positions[v];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
    const glm::dvec3 low = cell(p - tolerance), high = cell(p + tolerance);
    for (double x = low.x; x <= high.x; ++x)
      for (double y = low.y; y <= high.y; ++y)
        for (double z = low.z; z <= high.z; ++z) {
          const auto [first, last] = cells.equal_range({x, y, z});
          for (auto at = first; at != last; ++at)
            if (glm::distance(positions[at->second], p) <= tolerance) kept[v] = std::min(kept[v], at->second);
        }
    if (kept[v] == v) cells.emplace(cell(p), v);
  }
  for (Triangle& t : surface.triangles)
    for (std::uint32_t& v : t) v = kept[v];
  std::erase_if(surface.triangles,
                [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  drop_unused_vertices(surface.positions, surface.triangles);
}

}  // namespace tetpbd
