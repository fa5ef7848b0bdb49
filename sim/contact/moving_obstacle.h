// The obstacles of a step as they stand and move in each of its substeps: one list for all that meets them.
#pragma once

#include <vector>

#include "sim/contact/obstacle_kinds.h"
#include "sim/model/model.h"

namespace tetpbd {

/// An obstacle over a substep: as it stands at its end, and how its matter moves to there.
struct MovingObstacle {
  using Surface = Formulas<double>::Surface;

  const ObstacleKind* kind = default_obstacle_kind();
  Pose pose;
  glm::dvec3 velocity{0}, spin{0};  ///< m/s of the centre, rad/s
  double friction = 0, restitution = 0;
  bool own_friction = false;  ///< not the world's, which gives way to a body's
  double reach = 0;           ///< m: all of its surface is nearer to its centre
  /// Half spaces at rest that have no friction or restitution of their own, MAX_PLANES of a step, are no more
  /// than n.x >= d: (n, d).
  bool is_plane = false;
  glm::dvec4 plane{0};
  Formulas<double>::Solid solid{};
  const float* texels = nullptr;

  /// m/s, of its matter at x.
  glm::dvec3 velocity_at(const glm::dvec3& x) const {
    return is_plane ? glm::dvec3(0) : velocity + glm::cross(spin, x - pose.centre);
  }
  /// How far x is from it, and where to.
  Surface surface_at(const glm::dvec3& x) const { return is_plane ? plane_surface(x) : find_surface(x); }
  /// The plane that a point meets which came to x by `way` relative to the obstacle, and x's distance from
  /// it.
  Surface surface_met(const glm::dvec3& x, const glm::dvec3& way) const {
    return is_plane ? plane_surface(x) : find_contact(x, way);
  }
  /// The plane that a point meets which is at x and moves on by `moved`, relative to the obstacle by `way`,
  /// and the distance of x itself from it.
  Surface surface_ahead(const glm::dvec3& x, const glm::dvec3& moved, const glm::dvec3& way) const {
    if (is_plane) return plane_surface(x);
    const Surface met = find_contact(x + moved, way);
    return {met.normal, met.distance - glm::dot(met.normal, way)};
  }

 private:
  Surface plane_surface(const glm::dvec3& x) const {
    return {glm::dvec3(plane), glm::dot(glm::dvec3(plane), x) - plane.w};
  }
  Surface find_surface(const glm::dvec3& x) const;
  Surface find_contact(const glm::dvec3& x, const glm::dvec3& way) const;
};
/// `friction`, `restitution`: where the obstacle has none of its own.
MovingObstacle moving_obstacle(const Obstacle& obstacle, double start, double h, double friction, double restitution);

/// Of a vertex on it: the obstacle's own, else the body's own, else the world's.
inline double friction_on(const MovingObstacle& o, const Model& model, std::size_t vertex) {
  return o.own_friction ? o.friction : body_at(model, vertex).friction.value_or(o.friction);
}

/// All of a substep of h that begins at `start`. Half spaces that are no more than planes come first, with
/// the ground of the settings at their head.
std::vector<MovingObstacle> obstacles_at(const Model& model, const Settings& settings, double start, double h = 0);
/// Those of the model that are more than planes, in the order of a step.
std::vector<const Obstacle*> solid_obstacles(const Model& model);
bool has_obstacles(const Model& model, const Settings& settings);
/// Throws Error where there are more than a step has room for.
void check_obstacles(const Model& model);

/// The nearest place to x outside each in turn.
glm::dvec3 out_of_obstacles(const Model& model, const Settings& settings, double time, glm::dvec3 x);

}  // namespace tetpbd
