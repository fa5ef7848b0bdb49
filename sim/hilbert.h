// Places in space in an order that keeps neighbours together.
#pragma once

#include <cstdint>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Where a point of the box comes on a Hilbert curve through it, 21 bits an axis. Points that are not
/// numbers, and those outside, count as the nearest of the box.
std::uint64_t hilbert_key(const glm::dvec3& point, const Bounds& box);

}  // namespace tetpbd
