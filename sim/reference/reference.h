// Right answers, in double, of what the solvers approximate: motions (motion.h) and minima of the energy
// (objective.h). For comparing, not for speed: a Newton step takes 0.06 s at 3.5k tets and 0.4 s at 10k, a
// step of the body 3 to 40 of them. No solver takes a motion from this room; mode explicit takes its longest
// substep (leapfrog.h).
#pragma once

#include <vector>

#include "sim/model/constraints.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"
#include "sim/reference/objective.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// What is stepped. Of the settings: dt, substeps, gravity, damping, ground; the stiffnesses k play no part.
struct ReferenceInput {
  const Model& model;
  const ConstraintSystem& system;
  const Settings& settings;
  const std::vector<double>& inverse_masses;  ///< 1/kg, 0: fixed
};

/// Throws Error unless those of the kinds that have constraints are above 0, infinity included.
void require_compliances(const ConstraintSystem& system, const Compliances& compliances);

/// RMS (by mass) distance of two states over the size of the body (mean by mass of several):
/// `reference_distance`. No alignment: a displaced state is wrong.
double error_to(const Model& model, const State& reference, const State& state);

}  // namespace tetpbd
