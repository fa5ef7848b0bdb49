// Obstacles with a shape as they stand and move over a substep.
#pragma once

#include <vector>

#include "sim/formulas.h"
#include "sim/model.h"

namespace tetpbd {

/// A shape over a substep: as it stands at its end, and how its matter moves to there.
struct MovingShape {
  Formulas<double>::Solid solid{};
  const float* texels = nullptr;
  Pose pose;
  glm::dvec3 velocity{0}, spin{0};  ///< m/s of the centre, rad/s
  double friction = 0, restitution = 0;

  double reach() const;  ///< m: all of its surface is nearer to its centre; infinite of half spaces and heights
  glm::dvec3 velocity_at(const glm::dvec3& x) const { return velocity + glm::cross(spin, x - pose.centre); }
  /// How far x is from it, and where to; of a point that came there by `way` relative to the shape, from the
  /// plane that it meets.
  Formulas<double>::Surface surface_at(const glm::dvec3& x) const;
  Formulas<double>::Surface meeting(const glm::dvec3& x, const glm::dvec3& way) const;
};
/// `friction`, `restitution`: where the obstacle has none of its own.
MovingShape moving_shape(const Obstacle& obstacle, double start, double h, double friction,
                         double restitution);

/// Shapes over the substeps of h from `start` on, one list each; a single one where nothing moves.
std::vector<std::vector<MovingShape>> shapes_of(const Model& model, const Settings& settings, double start,
                                                double h, int substeps);

}  // namespace tetpbd
