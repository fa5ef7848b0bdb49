// Items by the cells of a regular grid that their boxes touch.
#pragma once

#include <unordered_map>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

inline bool are_apart(const Bounds& a, const Bounds& b) {
  return glm::any(glm::lessThan(a.high, b.low)) || glm::any(glm::lessThan(b.high, a.low));
}

inline Bounds grown(const Bounds& box, double by) { return {box.low - by, box.high + by}; }

class CellGrid {
 public:
  explicit CellGrid(double cell) : cell_(cell) {}  ///< edge of a cell, m
  void add(const Bounds& box, std::uint32_t item) {
    if (is_large(box)) return large_.push_back(item);
    for_each_cell(box, [&](const Cell& c) { items_[c].push_back(item); });
  }
  /// Calls f with the items in the box's cells, several times with one that is in several of them.
  template <class F>
  void for_each(const Bounds& box, F&& f) const {
    for (const std::uint32_t item : large_) f(item);
    if (is_large(box)) {
      for (const auto& [cell, items] : items_)
        for (const std::uint32_t item : items) f(item);
      return;
    }
    for_each_cell(box, [&](const Cell& c) {
      if (const auto found = items_.find(c); found != items_.end())
        for (const std::uint32_t item : found->second) f(item);
    });
  }

 private:
  using Cell = glm::ivec3;
  struct Hash {
    std::size_t operator()(const Cell& c) const {
      return std::size_t(c.x) * 73856093u ^ std::size_t(c.y) * 19349663u ^ std::size_t(c.z) * 83492791u;
    }
  };
  // Whether a box, as of a body that blew up, has too many cells or too large numbers of cells, or is not finite.
  bool is_large(const Bounds& box) const {
    const glm::dvec3 low = box.low / cell_, high = box.high / cell_, cells = glm::max(high - low, 0.0) + 1.0;
    const bool counted = glm::all(glm::lessThan(glm::max(glm::abs(low), glm::abs(high)), glm::dvec3(1e9)));
    return !(counted && cells.x * cells.y * cells.z < 1e5);
  }
  template <class F>
  void for_each_cell(const Bounds& box, F&& f) const {
    const Cell low(glm::floor(box.low / cell_)), high(glm::floor(box.high / cell_));
    for (Cell c = low; c.z <= high.z; ++c.z)
      for (c.y = low.y; c.y <= high.y; ++c.y)
        for (c.x = low.x; c.x <= high.x; ++c.x) f(c);
  }
  double cell_;
  std::vector<std::uint32_t> large_;
  std::unordered_map<Cell, std::vector<std::uint32_t>, Hash> items_;
};

}  // namespace tetpbd
