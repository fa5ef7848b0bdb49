// References, in double, for what the solvers approximate: motions (motion.h) and minima of the energy (objective.h).
// They are slow: a Newton step takes 0.06 s at 3.5k tets and 0.4 s at 10k, and a step of a body 3 to 40 of them. The
// solvers are independent of them, but for the longest substep of mode explicit (leapfrog.h).
#pragma once

#include <vector>

#include "sim/model/constraints.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"
#include "sim/reference/objective.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// The input of a reference run. The stiffnesses k and the solver among the settings play no part.
struct ReferenceInput {
  const Model& model;
  const ConstraintSystem& system;
  const Settings& settings;
  const std::vector<double>& inverse_masses;  ///< 1/kg, 0: fixed
  bool ten_node = false;                      ///< of halve_edges(): each eight neo-Hookean tets are one of ten nodes
};

/// Throws Error unless the compliances of all kinds that have constraints are above 0 (infinity is allowed).
void require_compliances(const ConstraintSystem& system, const Compliances& compliances);

/// The longest step that is stable about these positions, s, by the largest eigenvalues of M^-1 K and of the damping,
/// which power iteration finds from differences of forces. Bodies that deform far need shorter ones.
double stable_step(const ReferenceInput& input, const Compliances& compliances,
                   const std::vector<glm::dvec3>& positions, int iterations = 100);

/// The RMS distance (by mass) of two states over the size of the body, of several the mean by mass. States are not
/// aligned first: a displaced state has an error.
double error_to(const Model& model, const State& reference, const State& state);

}  // namespace tetpbd
