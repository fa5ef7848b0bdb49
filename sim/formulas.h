// The constraint formulas of shaders/ as C++: one text for GLSL, float and double.
#pragma once

#include <glm/glm.hpp>
#include <limits>

#include "sim/layout.h"

namespace tetpbd::glsl {

using namespace glm;

template <class Real>
struct Formulas {
  using real = Real;
  using vec3 = glm::vec<3, Real>;
  static constexpr real rounding = std::numeric_limits<real>::epsilon();
  static constexpr real grain = 0;  // positions are kept in full here
  using Ids = const uint*;
  static uint id_of(Ids ids, int j) { return ids[j]; }
  // in order of use
  // clang-format off
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#include "shaders/constraints/types.glsl"
#include "shaders/constraints/stretch.glsl"
#include "shaders/constraints/bend.glsl"
#include "shaders/constraints/volume.glsl"
#include "shaders/collision.glsl"
#pragma GCC diagnostic pop
  // clang-format on
};

}  // namespace tetpbd::glsl

namespace tetpbd {
using glsl::Formulas;
}
