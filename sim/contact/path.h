// A motion as that of a rigid body, by which obstacles and fixed vertices move.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace tetpbd {

struct Path {
  struct Key {
    double time = 0;                    ///< s
    glm::dvec3 centre{0}, rotation{0};  ///< m, degrees
  };
  glm::dvec3 centre{0};          ///< m, about which it turns
  glm::dvec3 rotation{0};        ///< degrees about x, then y, then z
  glm::dvec3 velocity{0};        ///< m/s
  glm::dvec3 spin{0};            ///< rad/s about the centre
  std::vector<Key> keyframes{};  ///< by time, linear in between and from the start, at rest after the last
};
bool moves(const Path& path);

struct Pose {
  glm::dvec3 centre{0};
  glm::dmat3 axes{1};  ///< columns: directions of its own axes
};
/// The rotation by angles in degrees about x, then y, then z.
glm::dmat3 rotation_of(const glm::dvec3& degrees);
Pose pose_at(const Path& path, double time);
/// Where a point that moves along is after `time` seconds, m.
glm::dvec3 moved_along(const Path& path, const glm::dvec3& start, double time);

}  // namespace tetpbd
