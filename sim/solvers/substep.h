#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/contact/moving_obstacle.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// Whether Jacobi shares masses out among a vertex's constraints; else it averages corrections. With
/// compliance always: with averages, a constraint's multiplier would not be what its vertices were moved by.
inline bool splits_masses(const Model& model, const Settings& settings) {
  return (settings.mass_splitting && !mode_of(settings).published) ||
         any_material(model, settings, compliant);
}

/// What moves a vertex in a substep besides its constraints.
struct Substep {
  const Model& model;
  double h, velocity_scale;
  glm::dvec3 gravity;
  ObstacleLists obstacles;  ///< of each substep of the step, or of all

  Substep(const Model& own, const Settings& settings, const Plan& plan, double time)
      : model(own),
        h(plan.h),
        velocity_scale(std::exp(-settings.damping * h)),
        gravity(0, -settings.gravity, 0),
        obstacles(obstacles_over(model, settings, time, h, plan.substeps)) {}
  const std::vector<MovingObstacle>& obstacles_in(int substep) const {
    return obstacles[std::min(std::size_t(substep), obstacles.size() - 1)];
  }
  /// Where prediction moves x (eqs. 1-2); changes v.
  glm::dvec3 predict(const glm::dvec3& x, glm::dvec3& v) const {
    v = (v + h * gravity) * velocity_scale;
    return x + h * v;
  }
  /// Vertex i at x, out of all obstacles (eqs. 11-12), in a substep by number.
  glm::dvec3 out_of_obstacles(int substep, std::size_t i, glm::dvec3 x, const glm::dvec3& predicted,
                              const glm::dvec3& v) const {
    for (const MovingObstacle& o : obstacles_in(substep)) {
      const glm::dvec3 way = h * (v - o.velocity_at(x)) + (x - predicted);
      const auto met = o.surface_met(x, way);
      if (met.distance < 0)
        x += Formulas<double>{}.plane_correction(met.normal, met.distance, way, friction_on(o, model, i));
    }
    return x;
  }
};

}  // namespace tetpbd
