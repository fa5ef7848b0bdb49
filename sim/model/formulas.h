// The formulas of shaders/ for constraints and contact as C++: one text serves GLSL, float and double.
#pragma once

#include <cmath>
#include <glm/glm.hpp>
#include <limits>

#include "sim/gl/layout.h"

namespace tetpbd::glsl {

using namespace glm;

/// The library functions that formulas call; LaneMath (sim/solvers/lane_math.h) can replace them.
struct LibraryMath {
  static auto atan(auto y, auto x) { return std::atan2(y, x); }
  static auto pow(auto x, auto y) { return std::pow(x, y); }
  static auto log(auto x) { return std::log(x); }
};

template <class Real, class Math = LibraryMath>
struct Formulas {
  using real = Real;
  using vec2 = glm::vec<2, Real>;
  using vec3 = glm::vec<3, Real>;
  using mat3 = glm::mat<3, 3, Real>;
  static constexpr real rounding = std::numeric_limits<real>::epsilon();
  static constexpr real quantization_size = 0;  // positions are kept in full here
  static real atan(real y, real x) { return Math::atan(y, x); }
  static real pow(real x, real y) { return Math::pow(x, y); }
  static real log(real x) { return Math::log(x); }
  const float* texels = nullptr;  // of an obstacle's field
  struct Surface;
  struct Solid;
  using Distance = Surface (Formulas::*)(Solid, vec3);
  Distance distance = nullptr;  // of the obstacle's kind
  real texel(int i) const { return real(texels[i]); }
  using Ids = const uint*;
  static uint id_of(Ids ids, int j) { return ids[j]; }
  // GCC 12 wrongly warns that `distance` is not initialised.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
  Surface surface_of(Solid s, vec3 p) { return (this->*distance)(s, p); }
#pragma GCC diagnostic pop
  // The files are in the order in which they use each other.
  // clang-format off
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#include "shaders/constraints/types.glsl"
#include "constraint_formulas.inc"  // CMake's: every other file there
#include "shaders/yield.glsl"
#include "shaders/contact/plane.glsl"
#include "shaders/contact/bodies/proximity.glsl"
#include "shaders/contact/solid.glsl"
#include "obstacle_formulas.inc"  // CMake's: every file of shaders/contact/obstacles
#include "shaders/contact/find_contact.glsl"
#include "shaders/contact/deepest.glsl"
#define SHARED_TOUCHES  // of a work-group in GLSL, of the caller in C++
#define TOUCHES Touch *contacts,
#include "shaders/contact/impulses.glsl"
#undef TOUCHES
#undef SHARED_TOUCHES
#pragma GCC diagnostic pop
  // clang-format on
};

}  // namespace tetpbd::glsl

namespace tetpbd {
using glsl::Formulas;
}
