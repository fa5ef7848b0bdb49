// What moves a vertex in a substep besides its constraints, on the CPU.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/contact/moving_obstacle.h"
#include "sim/loads.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// Whether Jacobi shares a vertex's mass out among its constraints, in place of averaging corrections. With compliance
/// it always does: with averages, a constraint's multiplier would not be what moved its vertices.
inline bool splits_masses(const Settings& settings) {
  const SolverMode& mode = solver_mode(settings);
  if (mode.in_place) return false;
  return (settings.mass_splitting && !mode.published) || any_material(settings, compliant);
}

/// Whether faces are moved out of obstacles (faces.h) after this substep of a step: not after each that is very short,
/// but after the last.
inline bool are_faces_due(const Plan& plan, int substep) {
  constexpr double often_enough = 1.25e-3;  // s
  const int times = std::clamp(int(std::ceil(plan.h * plan.substeps / often_enough)), 1, plan.substeps);
  return (substep + 1) * times / plan.substeps > substep * times / plan.substeps;
}

struct Substep {
  double h, velocity_scale;
  glm::dvec3 gravity;
  std::vector<MovingObstacle> obstacles;  ///< of the substep that began last
  bool moving;                            ///< obstacles differ from one substep to the next
  std::vector<glm::dvec3> loads{};        ///< m/s^2 by vertex, beside gravity; empty: none

  /// The first substep of a step that begins at `time`. The model and the settings have to live longer than it.
  Substep(const Model& model, const Settings& settings, const Plan& plan, double time)
      : h(plan.h),
        velocity_scale(std::exp(-settings.damping * h)),
        gravity(0, -settings.gravity, 0),
        obstacles(obstacles_at(model, settings, time, h)),
        moving(std::ranges::any_of(model.obstacles, moves)),
        model_(model),
        settings_(settings),
        time_(time) {}
  /// Whether `work` is booked on vertices.
  bool books_work() const { return moving || !model_.loads.empty() || !model_.fibres.empty(); }
  /// Goes on to a substep by number.
  void begin(int substep) {
    if (moving && substep > 0) obstacles = obstacles_at(model_, settings_, time_ + substep * h, h);
  }
  /// Returns where prediction moves vertex i from x, and changes v (eqs. 1-2).
  glm::dvec3 predict(std::size_t i, const glm::dvec3& x, glm::dvec3& v) const {
    v = (v + h * (loads.empty() ? gravity : gravity + loads[i])) * velocity_scale;
    return x + h * v;
  }
  /// Finds the loads of the substep that begins; x(i) is a position.
  void find_loads(const std::vector<glm::uvec4>& mesh, const auto& x, const std::vector<glm::dvec3>& v) {
    if (model_.loads.empty() || (!loads.empty() && !load_faces(model_))) return;
    const LoadsAt now{load_records(model_, time_of_loads(settings_, time_)), mesh};
    loads.resize(v.size());
    for (std::uint32_t i = 0; i < v.size(); ++i)
      loads[i] = now.acceleration(
          i, x, [&](std::uint32_t u) { return v[u]; }, model_.inverse_masses[i], h);
  }
  /// Adds to `work` what loads do on vertex i, which ends the substep with velocity v.
  void book_loads(std::size_t i, const glm::dvec3& v, std::vector<double>& work) const {
    if (!loads.empty()) work[i] += model_.masses[i] * h * glm::dot(loads[i], v);
  }
  /// Returns where vertex i at x goes out of all obstacles (eqs. 48-49), and adds to `work` what they do on it.
  glm::dvec3 out_of_obstacles(std::size_t i, glm::dvec3 x, const glm::dvec3& predicted, const glm::dvec3& v,
                              double* work = nullptr) const {
    for (const MovingObstacle& o : obstacles) {
      const glm::dvec3 displacement = h * (v - o.velocity_at(x)) + (x - predicted);
      const auto met = o.surface_met(x, displacement);
      if (!(met.distance < 0)) continue;
      const glm::dvec3 correction = Formulas<double>{}.plane_correction(
          met.normal, met.distance, displacement, friction_on(o, settings_, body_at(model_, i).number));
      if (work) *work += model_.masses[i] / h * glm::dot(correction, o.velocity_at(x));
      x += correction;
    }
    return x;
  }

 private:
  const Model& model_;
  const Settings& settings_;
  double time_;
};

}  // namespace tetpbd
