// shaders/layout.glsl as C++: the same text, so the two cannot drift apart (a test also asks GL for the offsets).
#pragma once

#include <glm/glm.hpp>

namespace tetpbd {
using glm::ivec3;
using glm::vec3;
using glm::vec4;
#include "shaders/layout.glsl"
}  // namespace tetpbd
