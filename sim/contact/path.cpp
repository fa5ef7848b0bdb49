#include "sim/contact/path.h"

#define GLM_ENABLE_EXPERIMENTAL  // euler_angles

#include <algorithm>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtx/euler_angles.hpp>

namespace tetpbd {

namespace {

glm::dmat3 rotate_about(const glm::dvec3& axis) {
  const double angle = glm::length(axis);
  return angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, axis / angle)) : glm::dmat3(1);
}

}  // namespace

bool moves(const Path& p) { return p.velocity != glm::dvec3(0) || p.spin != glm::dvec3(0) || !p.keyframes.empty(); }

glm::dmat3 rotation_of(const glm::dvec3& degrees) {
  const glm::dvec3 angle = glm::radians(degrees);
  return glm::dmat3(glm::eulerAngleZYX(angle.z, angle.y, angle.x));
}

Pose pose_at(const Path& p, double time) {
  Path::Key now{time, p.centre, p.rotation}, last{0, p.centre, p.rotation};
  for (const Path::Key& key : p.keyframes) {
    if (time < key.time) {
      const double part = std::max(0.0, time - last.time) / (key.time - last.time);
      now.centre = glm::mix(last.centre, key.centre, part);
      now.rotation = glm::mix(last.rotation, key.rotation, part);
      break;
    }
    last = key, now.centre = key.centre, now.rotation = key.rotation;
  }
  return {now.centre + time * p.velocity, rotate_about(time * p.spin) * rotation_of(now.rotation)};
}

glm::dvec3 moved_along(const Path& path, const glm::dvec3& start, double time) {
  const Pose before = pose_at(path, 0), now = pose_at(path, time);
  return now.centre + now.axes * (glm::transpose(before.axes) * (start - before.centre));
}

}  // namespace tetpbd
