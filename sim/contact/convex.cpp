#include "sim/contact/convex.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tetpbd {

namespace {

struct Edges {
  std::array<glm::dvec3, 6> all;
  std::size_t count = 0;
};
Edges edges(const ConvexCell& cell) {
  Edges found;
  for (std::size_t i = 0; i + 1 < std::size_t(cell.count); ++i)
    for (std::size_t j = i + 1; j < std::size_t(cell.count); ++j)
      found.all[found.count++] = cell.corners[j] - cell.corners[i];
  return found;
}

// Calls f with each unit axis along which the two can be separated, if they can be, until it returns false.
template <class F>
void for_each_axis(const ConvexCell& a, const ConvexCell& b, F&& f) {
  const Edges from_a = edges(a), from_b = edges(b);
  const auto try_cross = [&](const glm::dvec3& u, const glm::dvec3& v) {
    const glm::dvec3 axis = glm::cross(u, v);
    const double squared = glm::dot(axis, axis);
    return !(squared > 1e-18 * glm::dot(u, u) * glm::dot(v, v)) || f(axis / std::sqrt(squared));  // parallel: no plane
  };
  for (const Edges* own : {&from_a, &from_b})  // two edges of one face give its normal
    for (std::size_t i = 0; i < own->count; ++i)
      for (std::size_t j = i + 1; j < own->count; ++j)
        if (!try_cross(own->all[i], own->all[j])) return;
  for (std::size_t i = 0; i < from_a.count; ++i)
    for (std::size_t j = 0; j < from_b.count; ++j)
      if (!try_cross(from_a.all[i], from_b.all[j])) return;
}

struct Interval {
  double low, high;
};
Interval project(const ConvexCell& cell, const glm::dvec3& axis) {
  const auto [low, high] = std::minmax({glm::dot(cell.corners[0], axis), glm::dot(cell.corners[1], axis),
                                        glm::dot(cell.corners[2], axis), glm::dot(cell.corners[3], axis)});
  return {low, high};
}

}  // namespace

double overlap_depth(const ConvexCell& a, const ConvexCell& b, double gap) {
  double depth = std::numeric_limits<double>::infinity();
  for_each_axis(a, b, [&](const glm::dvec3& axis) {
    const Interval on_a = project(a, axis), on_b = project(b, axis);
    depth = std::min({depth, on_a.high - on_b.low + gap, on_b.high - on_a.low + gap});
    return depth > 0;
  });
  return std::isfinite(depth) ? std::max(depth, 0.0) : 0;
}

double exit_distance(const ConvexCell& a, const ConvexCell& b, const glm::dvec3& direction, double enough, double gap) {
  double distance = std::numeric_limits<double>::infinity();
  for_each_axis(a, b, [&](const glm::dvec3& axis) {
    const double along = glm::dot(direction, axis);
    if (std::abs(along) < 1e-9) return true;
    const Interval on_a = project(a, axis), on_b = project(b, axis);
    distance =
        std::min(distance, (along > 0 ? on_b.high - on_a.low + gap : on_a.high - on_b.low + gap) / std::abs(along));
    return distance > enough;
  });
  return distance;
}

}  // namespace tetpbd
