#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/moving_shape.h"
#include "sim/settings.h"

namespace tetpbd {

/// Whether Jacobi shares masses out among a vertex's constraints; else it averages corrections. With
/// compliance always: with averages, a constraint's multiplier would not be what its vertices were moved by.
inline bool splits_masses(const Settings& settings) {
  return (settings.mass_splitting && settings.mode != "paper") || compliant(settings);
}

/// What moves a vertex in a substep besides its constraints.
struct Substep {
  double h, velocity_scale, friction;
  glm::dvec3 gravity;
  std::vector<glm::dvec4> planes;                ///< half spaces n.x >= d as (n, d)
  std::vector<std::vector<MovingShape>> shapes;  ///< of each substep of the step, or of all

  Substep(const Model& model, const Settings& settings, const Plan& plan, double time)
      : h(plan.h),
        velocity_scale(std::exp(-settings.damping * h)),
        friction(settings.friction),
        gravity(0, -settings.gravity, 0),
        planes(planes_of(model, settings)),
        shapes(shapes_of(model, settings, time, h, plan.substeps)) {}
  const std::vector<MovingShape>& shapes_in(int substep) const {
    return shapes[std::min(std::size_t(substep), shapes.size() - 1)];
  }
  /// Where prediction moves x (eqs. 1-2); changes v.
  glm::dvec3 predict(const glm::dvec3& x, glm::dvec3& v) const {
    v = (v + h * gravity) * velocity_scale;
    return x + h * v;
  }
  /// x out of all half spaces and shapes (eqs. 11-12), in a substep by number.
  glm::dvec3 out_of_obstacles(int substep, glm::dvec3 x, const glm::dvec3& predicted,
                              const glm::dvec3& v) const {
    for (const glm::dvec4& plane : planes) {
      const glm::dvec3 n(plane);
      const double depth = glm::dot(n, x) - plane.w;
      if (depth < 0) x += Formulas<double>{}.plane_correction(n, depth, h * v + (x - predicted), friction);
    }
    for (const MovingShape& shape : shapes_in(substep)) {
      const glm::dvec3 way = h * (v - shape.velocity_at(x)) + (x - predicted);
      const auto met = shape.meeting(x, way);
      if (met.distance < 0)
        x += Formulas<double>{}.plane_correction(met.normal, met.distance, way, shape.friction);
    }
    return x;
  }
};

}  // namespace tetpbd
