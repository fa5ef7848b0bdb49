#include "sim/mesh/weld.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <unordered_map>

#include "sim/mesh/bytes.h"

namespace tetpbd {
namespace {

constexpr std::uint32_t none = ~std::uint32_t{0};

bool is_finite(const glm::dvec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

using Cell = std::array<std::int64_t, 3>;
struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    return hash_bytes({reinterpret_cast<const char*>(cell.data()), sizeof cell}, 1);
  }
};

// A grid of cells eight tolerances wide: a point looks into its own cell, and into a neighbour only where it
// stands within a tolerance of the wall between them.
struct Grid {
  glm::dvec3 origin;
  double width, tolerance;
  std::unordered_map<Cell, std::uint32_t, CellHash> first;  // cell -> a vertex in it
  std::vector<std::uint32_t> next;                          // vertex -> the next one in its cell

  Cell cell(const glm::dvec3& p) const {
    const glm::dvec3 at = (p - origin) / width;
    return {std::llround(std::floor(at.x)), std::llround(std::floor(at.y)), std::llround(std::floor(at.z))};
  }

  std::uint32_t find(const std::vector<glm::dvec3>& positions, const glm::dvec3& p) const {
    const Cell low = cell(p - glm::dvec3(tolerance)), high = cell(p + glm::dvec3(tolerance));
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const auto found = first.find({x, y, z});
          if (found == first.end()) continue;
          for (std::uint32_t v = found->second; v != none; v = next[v])
            if (glm::length(positions[v] - p) <= tolerance) return v;
        }
    return none;
  }

  void add(std::uint32_t v, const glm::dvec3& p) {
    const auto [at, fresh] = first.try_emplace(cell(p), v);
    if (fresh) return;
    next[v] = at->second;
    at->second = v;
  }
};

}  // namespace

void weld(SurfaceMesh& surface, double tolerance) {
  auto& positions = surface.positions;
  glm::dvec3 low(INFINITY);
  double largest = 0;
  for (const glm::dvec3& p : positions)
    if (is_finite(p)) {
      low = glm::min(low, p);
      largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
  // A mesh far from the origin has no finer steps than its own numbers; the floor also keeps cell indices in
  // 64 bits.
  tolerance = std::max({tolerance, largest * 1e-15, 1e-300});
  Grid grid{low, 8 * tolerance, tolerance, {}, std::vector<std::uint32_t>(positions.size(), none)};
  grid.first.reserve(positions.size());

  std::vector<std::uint32_t> kept(positions.size());
  for (std::uint32_t v = 0; v < positions.size(); ++v) {
    kept[v] = v;
    if (!is_finite(positions[v])) continue;
    const std::uint32_t same = grid.find(positions, positions[v]);
    if (same == none)
      grid.add(v, positions[v]);
    else
      kept[v] = same;
  }
  for (Triangle& t : surface.triangles)
    for (std::uint32_t& v : t) v = kept[v];
  std::erase_if(surface.triangles,
                [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });

  std::vector<std::uint32_t> renumbered(positions.size(), none);
  for (const Triangle& t : surface.triangles)
    for (const std::uint32_t v : t) renumbered[v] = 0;
  std::uint32_t count = 0;
  for (std::uint32_t v = 0; v < positions.size(); ++v)
    if (renumbered[v] != none) {
      renumbered[v] = count;
      positions[count++] = positions[v];
    }
  positions.resize(count);
  for (Triangle& t : surface.triangles)
    for (std::uint32_t& v : t) v = renumbered[v];
}

}  // namespace tetpbd
