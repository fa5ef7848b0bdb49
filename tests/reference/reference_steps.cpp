#include "tests/reference/reference_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/rotation.h"

namespace tetpbd {

namespace {

void refuse_contact(const ReferenceInput& input, const Points& positions) {
  const auto obstacles = obstacles_at(input.model, input.settings, 0);
  const auto inside = [&](const glm::dvec3& x) {
    return std::ranges::any_of(obstacles, [&](auto& o) { return o.surface_at(x).distance < 0; });
  };
  for (std::size_t i = 0; i < positions.size(); ++i)
    if (input.inverse_masses[i] > 0 && inside(positions[i]))
      throw Error("the reference knows no contact", fmt::format("vertex {} is inside an obstacle", i),
                  "compare before the first contact, or without the ground", 1);
}

// v += h g, damped, y = x + h v: the same first part of a substep as CpuPbd and predict.comp.
void predict(const ReferenceInput& input, State& state, double h) {
  const double velocity_scale = std::exp(-input.settings.damping * h);
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    if (input.inverse_masses[i] > 0) {
      state.velocities[i] = (state.velocities[i] + h * glm::dvec3(0, -input.settings.gravity, 0)) * velocity_scale;
      state.positions[i] += h * state.velocities[i];
    }
}

// `state` as predicted; it moves on to `positions`.
void finish(State& state, const Points& positions, double h) {
  for (std::size_t i = 0; i < positions.size(); ++i) state.velocities[i] += (positions[i] - state.positions[i]) / h;
  state.positions = positions;
}

// The rest shape of one body put where it is nearest to `to`, by mass.
void align(const ReferenceInput& input, const Body& body, const Points& to, Points& placed) {
  const Points& rest = input.model.rest.positions;
  const std::size_t first = body.first_vertex, end = first + body.vertices;
  double mass = 0;
  glm::dvec3 centre(0), rest_centre(0);
  for (std::size_t i = first; i < end; ++i) {
    const double m = 1 / input.inverse_masses[i];
    mass += m, centre += m * to[i], rest_centre += m * rest[i];
  }
  centre /= mass, rest_centre /= mass;
  glm::dmat3 covariance(0);
  for (std::size_t i = first; i < end; ++i)
    covariance += glm::outerProduct(to[i] - centre, rest[i] - rest_centre) / input.inverse_masses[i];
  const BestRotation best = best_rotation(covariance);
  if (!best.unique)
    throw Error("no best rotation", "predicted positions of " + body.name + " are on a line, a point or mirrored",
                "start nearer to the rest shape", 1);
  for (std::size_t i = first; i < end; ++i) placed[i] = centre + best.R * (rest[i] - rest_centre);
}

}  // namespace

State rigid_step(const ReferenceInput& input, State state) {
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    if (!(input.inverse_masses[i] > 0))
      throw Error("the rigid step needs free bodies", fmt::format("vertex {} is fixed", i), "unpin it");
  const double h = plan_for(input.settings).h;
  for (int s = 0; s < plan_for(input.settings).substeps; ++s) {
    predict(input, state, h);
    refuse_contact(input, state.positions);
    Points placed = state.positions;
    for (const Body& body : input.model.bodies) align(input, body, state.positions, placed);
    refuse_contact(input, placed);
    finish(state, placed, h);
  }
  return state;
}

namespace {

Objective make_objective(const ReferenceInput& input, const Compliances& compliances) {
  require_compliances(input.system, compliances);
  Objective o{.system = input.system, .compliances = compliances, .masses = {}, .predicted = {}};
  for (double w : input.inverse_masses) o.masses.push_back(w > 0 ? 1 / w : 0);
  return o;
}

double total_mass(const Objective& o) { return std::accumulate(o.masses.begin(), o.masses.end(), 0.0); }

Error no_convergence(const Minimum& result, const char* hint) {
  return {"the reference did not converge",
          fmt::format("{} after {}, residual {:.1e}", result.reason, result.iterations, result.residual), hint, 1};
}

}  // namespace

Objective step_objective(const ReferenceInput& input, State state, const Compliances& compliances, double h) {
  Objective o = make_objective(input, compliances);
  predict(input, state, h);
  o.predicted = std::move(state.positions);
  o.inertia = 1 / (h * h);
  o.unit = total_mass(o) * o.inertia * input.model.size * input.model.size;
  return o;
}

Objective static_objective(const ReferenceInput& input, const Points& positions, const Compliances& compliances) {
  Objective o = make_objective(input, compliances);
  o.predicted = positions;
  o.gravity.y = -input.settings.gravity;
  o.unit = total_mass(o) * input.settings.gravity * input.model.size;
  return o;
}

ReferenceStep implicit_euler_step(const ReferenceInput& input, State state, const Compliances& compliances,
                                  const Points* guess) {
  const double h = plan_for(input.settings).h;
  ReferenceStep step;
  for (int s = 0; s < plan_for(input.settings).substeps; ++s) {
    const Objective objective = step_objective(input, state, compliances, h);
    predict(input, state, h);
    refuse_contact(input, state.positions);
    Minimum result = minimise(objective, guess && s == 0 ? *guess : state.positions);
    if (!result.converged) throw no_convergence(result, "use a smaller step or a larger compliance");
    refuse_contact(input, result.positions);
    for (std::size_t i = 0; i < state.positions.size(); ++i)
      if (!(input.inverse_masses[i] > 0)) result.positions[i] = state.positions[i];  // not even by rounding
    finish(state, result.positions, h);
    step.iterations += result.iterations;
    step.residual = std::max(step.residual, result.residual);
  }
  step.state = std::move(state);
  return step;
}

ReferenceStep static_equilibrium(const ReferenceInput& input, const Points& positions, const Compliances& compliances) {
  const bool held =
      std::any_of(input.inverse_masses.begin(), input.inverse_masses.end(), [](double w) { return w == 0; });
  if (!held || !(input.settings.gravity > 0))
    throw Error("nothing hangs", held ? "gravity is 0" : "no vertex is fixed", "fix vertices and set gravity");
  const Objective full = static_objective(input, positions, compliances);
  for (int loads = 1;; loads *= 2) {
    Minimum result;
    result.positions = positions;
    int iterations = 0;
    for (int load = 1; load <= loads; ++load) {
      Objective part = full;
      part.gravity *= double(load) / loads;
      result = minimise(part, std::move(result.positions));
      iterations += result.iterations;
      if (!result.converged) break;
    }
    if (result.converged) {
      refuse_contact(input, result.positions);
      for (std::size_t i = 0; i < positions.size(); ++i)
        if (input.inverse_masses[i] == 0) result.positions[i] = positions[i];
      return {{std::move(result.positions), Points(positions.size(), glm::dvec3(0))}, iterations, result.residual};
    }
    if (loads == 64) throw no_convergence(result, "hold more vertices, or start nearer to equilibrium");
  }
}

}  // namespace tetpbd
