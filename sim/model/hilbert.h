// An order of points in space that keeps neighbours together.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// The place of a point on a Hilbert curve through the box, with 21 bits an axis (J. Skilling, "Programming the Hilbert
/// curve", AIP Conference Proceedings 707, 2004). A point outside counts as the nearest one inside, NaN as the least.
inline std::uint64_t hilbert_key(const glm::dvec3& point, const Bounds& box) {
  constexpr int bits = 21;
  constexpr std::uint32_t top = 1u << (bits - 1);
  std::array<std::uint32_t, 3> x;
  for (int a = 0; a < 3; ++a) {
    const double extent = std::max(box.high[a] - box.low[a], 1e-300);
    const double part = (point[a] - box.low[a]) / extent * double(1u << bits);
    x[std::size_t(a)] = part > 0 ? std::uint32_t(std::min(part, double((1u << bits) - 1))) : 0;
  }
  for (std::uint32_t q = top; q > 1; q >>= 1) {
    const std::uint32_t below = q - 1;
    for (std::uint32_t& axis : x)
      if (axis & q) {
        x[0] ^= below;
      } else {
        const std::uint32_t swapped = (x[0] ^ axis) & below;
        x[0] ^= swapped;
        axis ^= swapped;
      }
  }
  x[1] ^= x[0];
  x[2] ^= x[1];
  std::uint32_t flip = 0;
  for (std::uint32_t q = top; q > 1; q >>= 1)
    if (x[2] & q) flip ^= q - 1;
  std::uint64_t key = 0;
  for (int bit = bits - 1; bit >= 0; --bit)
    for (const std::uint32_t axis : x) key = key << 1 | (((axis ^ flip) >> bit) & 1);
  return key;
}

}  // namespace tetpbd
