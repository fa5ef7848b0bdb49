// shaders/render/layout.glsl as C++. It is the same text, so the two cannot drift apart.
#pragma once

#include <glm/glm.hpp>

#include "sim/gl/layout.h"

namespace tetpbd {
using glm::mat4;
using glm::uint;
using glm::vec3;
using glm::vec4;
#include "shaders/render/layout.glsl"
}  // namespace tetpbd
