// The obstacles of a step as they stand and move in each of its substeps: one list for all who need contact with them.
#pragma once

#include <vector>

#include "sim/contact/obstacle_kinds.h"
#include "sim/model/model.h"

namespace tetpbd {

/// An obstacle at the end of a substep, and its motion in it.
struct MovingObstacle {
  using Surface = Formulas<double>::Surface;

  const ObstacleKind* kind = default_obstacle_kind();
  Pose pose;
  glm::dvec3 velocity{0}, spin{0};              ///< m/s of the centre, rad/s
  std::optional<double> friction, restitution;  ///< its own, before those of bodies and of the world
  double reach = 0;  ///< m, no shorter than the distance of any point of its surface from its centre
  /// Half spaces at rest without friction or restitution of their own, at most MAX_PLANES in a step, are described by
  /// their plane n.x >= d alone, as (n, d).
  bool is_plane = false;
  glm::dvec4 plane{0};
  Formulas<double>::Solid solid{};
  const float* texels = nullptr;

  /// m/s, of the obstacle's material at x.
  glm::dvec3 velocity_at(const glm::dvec3& x) const {
    return is_plane ? glm::dvec3(0) : velocity + glm::cross(spin, x - pose.centre);
  }
  /// The signed distance of x and its gradient.
  Surface surface_at(const glm::dvec3& x) const { return is_plane ? plane_surface(x) : find_surface(x); }
  /// The contact plane of a point that came to x by a displacement relative to the obstacle, and the signed distance
  /// of x from that plane.
  Surface surface_met(const glm::dvec3& x, const glm::dvec3& displacement) const {
    return is_plane ? plane_surface(x) : find_contact(x, displacement);
  }
  /// The contact plane of a point that will move from x by `moved`, and relative to the obstacle by `displacement`,
  /// and the signed distance of x itself from that plane.
  Surface surface_ahead(const glm::dvec3& x, const glm::dvec3& moved, const glm::dvec3& displacement) const {
    if (is_plane) return plane_surface(x);
    const Surface contact = find_contact(x + moved, displacement);
    return {contact.normal, contact.distance - glm::dot(contact.normal, displacement)};
  }

 private:
  Surface plane_surface(const glm::dvec3& x) const {
    return {glm::dvec3(plane), glm::dot(glm::dvec3(plane), x) - plane.w};
  }
  Surface find_surface(const glm::dvec3& x) const;
  Surface find_contact(const glm::dvec3& x, const glm::dvec3& displacement) const;
};
/// Over a substep of h from `start` on, s.
MovingObstacle moving_obstacle(const Obstacle& obstacle, double start, double h);

/// Of a body on the obstacle, by its number.
inline double friction_on(const MovingObstacle& o, const Settings& settings, std::size_t body) {
  return o.friction ? *o.friction : friction_of(settings, body);
}
inline double restitution_on(const MovingObstacle& o, const Settings& settings, std::size_t body) {
  return o.restitution ? *o.restitution : restitution_of(settings, body);
}

/// All obstacles over a substep of h from `start` on, s: first those that are only planes, led by the ground.
std::vector<MovingObstacle> obstacles_at(const Model& model, const Settings& settings, double start, double h = 0);
/// The model's obstacles that are more than planes, in the order of obstacles_at().
std::vector<const Obstacle*> solid_obstacles(const Model& model);
bool has_obstacles(const Model& model, const Settings& settings);

/// x moved to the nearest point of each obstacle's surface in turn where it is inside.
glm::dvec3 out_of_obstacles(const Model& model, const Settings& settings, double time, glm::dvec3 x);

}  // namespace tetpbd
