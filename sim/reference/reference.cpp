#include "sim/reference/reference.h"

#include <fmt/format.h>

#include <cmath>

#include "sim/error.h"

namespace tetpbd {

void require_compliances(const ConstraintSystem& system, const Compliances& compliances) {
  for (std::size_t k = 0; k < compliances.size(); ++k)
    if (system.lists[k].count() > 0 && system.lists[k].compliance.empty() && !(compliances[k] > 0))
      throw Error("compliance must be above 0", fmt::format("{} of {}", compliances[k], constraint_kinds[k].name),
                  "rigid_step is the limit of 0, infinity leaves a kind out");
}

double error_to(const Model& model, const State& reference, const State& state) {
  double mass = 0, size = 0, squares = 0;
  for (std::size_t i = 0; i < model.masses.size(); ++i) {
    const glm::dvec3 apart = state.positions[i] - reference.positions[i];
    mass += model.masses[i];
    squares += model.masses[i] * glm::dot(apart, apart);
  }
  for (const Body& body : model.bodies)
    size += body_mass(model, body) / mass * body_bounds(body, model.rest.positions).size();
  return std::sqrt(squares / mass) / size;
}

}  // namespace tetpbd
