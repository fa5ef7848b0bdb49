// What is where: lists by cells of space, of what a box touches.
#pragma once

#include <unordered_map>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

class CellGrid {
 public:
  explicit CellGrid(double cell) : cell_(cell) {}  ///< m
  void add(const Bounds& box, std::uint32_t what) {
    if (is_large(box)) return large_.push_back(what);
    for_each_cell(box, [&](const Cell& c) { lists_[c].push_back(what); });
  }
  /// Calls f with what is in the box's cells; what is in several of them comes several times.
  template <class F>
  void for_each(const Bounds& box, F&& f) const {
    for (const std::uint32_t what : large_) f(what);
    if (is_large(box)) {
      for (const auto& [cell, list] : lists_)
        for (const std::uint32_t what : list) f(what);
      return;
    }
    for_each_cell(box, [&](const Cell& c) {
      if (const auto found = lists_.find(c); found != lists_.end())
        for (const std::uint32_t what : found->second) f(what);
    });
  }

 private:
  // In too many cells, or too far out to count them, as where a body is blown up; also what is not finite.
  bool is_large(const Bounds& box) const {
    const glm::dvec3 low = box.low / cell_, high = box.high / cell_, cells = glm::max(high - low, 0.0) + 1.0;
    const bool counted = glm::all(glm::lessThan(glm::max(glm::abs(low), glm::abs(high)), glm::dvec3(1e9)));
    return !(counted && cells.x * cells.y * cells.z < 1e5);
  }
  using Cell = glm::ivec3;
  struct Hash {
    std::size_t operator()(const Cell& c) const {
      return std::size_t(c.x) * 73856093u ^ std::size_t(c.y) * 19349663u ^ std::size_t(c.z) * 83492791u;
    }
  };
  template <class F>
  void for_each_cell(const Bounds& box, F&& f) const {
    const Cell low(glm::floor(box.low / cell_)), high(glm::floor(box.high / cell_));
    for (Cell c = low; c.z <= high.z; ++c.z)
      for (c.y = low.y; c.y <= high.y; ++c.y)
        for (c.x = low.x; c.x <= high.x; ++c.x) f(c);
  }
  double cell_;
  std::vector<std::uint32_t> large_;
  std::unordered_map<Cell, std::vector<std::uint32_t>, Hash> lists_;
};

}  // namespace tetpbd
