// A hard body in contact with others (method.md, "Hard bodies in contact"): how it moves in a substep as a rigid one,
// and what pairs of surfaces do to it. As a velocity times the substep's length is a way, an impulse here is in kg m.
#pragma once

#include "sim/model/formulas.h"
#include "sim/model/model.h"

namespace tetpbd {

struct HardBody {
  bool moves = false;       ///< as a rigid one, in this substep
  double inverse_mass = 0;  ///< 1/kg
  glm::dvec3 centre{0};     ///< m, where the substep began
  glm::dmat3 inverse_inertia{0};
  glm::dvec3 way{0}, turn{0};              ///< m, rad, in this substep
  glm::dvec3 changed{0}, changed_turn{0};  ///< m, rad, what pairs have changed of these
  glm::dvec3 pushed{0}, pushed_turn{0};    ///< m, rad, of its place alone
  Wrench next{};                           ///< with which it begins the next substep
  int pairs = 0, active = 0;               ///< that act on it; of these, what have an impulse or need one

  glm::dvec3 way_at(const glm::dvec3& arm) const { return way + glm::cross(turn, arm); }
  /// The way at a point per impulse there, on one pair's part of the mass.
  glm::dmat3 response_at(const glm::dvec3& arm, int sharing) const {
    const glm::dmat3 cross(0, arm.z, -arm.y, -arm.z, 0, arm.x, arm.y, -arm.x, 0);
    return double(sharing) * (glm::dmat3(inverse_mass) + glm::transpose(cross) * inverse_inertia * cross);
  }
  void change(const glm::dvec3& more, const glm::dvec3& arm) {
    const glm::dvec3 moved = inverse_mass * more, turned = inverse_inertia * glm::cross(arm, more);
    way += moved, changed += moved, turn += turned, changed_turn += turned;
  }
  void note(const glm::dvec3& warm, const glm::dvec3& push, const glm::dvec3& arm) {
    next.impulse += inverse_mass * warm, next.turning += inverse_mass * glm::cross(arm, warm), next.about = centre;
    pushed += inverse_mass * push, pushed_turn += inverse_inertia * glm::cross(arm, push);
  }
};

/// After a substep that ended with `impulse`: no more than in the one before it, so that a blow does not go on.
inline WarmImpulse followed(const WarmImpulse& before, const glm::dvec3& impulse) {
  const double size = glm::length(impulse);
  return {size > before.size ? impulse * (before.size / size) : impulse, size};
}

}  // namespace tetpbd
