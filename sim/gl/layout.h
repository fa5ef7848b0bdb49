// shaders/layout.glsl as C++: the same text, so that the two always agree (a test also asks GL for the offsets).
#pragma once

#include <glm/glm.hpp>

namespace tetpbd {
namespace layout {
using glm::ivec3;
using glm::uint;
using glm::vec3;
using glm::vec4;
#include "shaders/layout.glsl"
}  // namespace layout
using layout::ObstacleRecord;
using layout::Position;
using layout::RigidRecord;
using layout::Step;
using layout::Velocity;
static_assert(sizeof(Position) == 32 && sizeof(Velocity) == 32 && sizeof(layout::Record4) == 20);
static_assert(sizeof(ObstacleRecord) == 160);
static_assert(sizeof(Step) == 96 + 48 + 16 * MAX_PLANES + 48 + 4 * MAX_ACTIVATIONS);
}  // namespace tetpbd
