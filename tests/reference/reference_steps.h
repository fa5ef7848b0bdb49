// Single steps with known right answers, in double, for the tests: the rigid step (k = 1), the implicit-Euler
// step (compliance above 0) and static equilibrium. None knows contact: each throws Error where its answer or
// prediction is inside an obstacle.
#pragma once

#include "sim/reference/reference.h"

namespace tetpbd {

/// The exact PBD step where every constraint has k = 1 and all edges are kept: the minimiser of sum m |p -
/// y|^2 over the rigid placements p of the rest shape, y the predicted positions (v += h g, damped, y = x + h
/// v), then v += (p - y) / h, as in CpuPbd. Rotation by Kabsch (Acta Cryst. A32, 1976), by SVD, reflections
/// excluded. Each body for itself; a body is taken to be connected. `settings.substeps` such steps of dt /
/// substeps. Throws Error for fixed vertices, and where no best rotation exists (predicted positions all on a
/// line, say).
State rigid_step(const ReferenceInput& input, State state);

/// The implicit-Euler step of length h (s) from `state`: inertia 1/h^2, unit M size^2 / h^2 with M the moving
/// mass.
Objective step_objective(const ReferenceInput& input, State state, const Compliances& compliances, double h);
/// Rest under gravity: no inertia, unit M g size. `positions`: where fixed vertices are held.
Objective static_objective(const ReferenceInput& input, const Points& positions, const Compliances& compliances);

struct ReferenceStep {
  State state;
  int iterations = 0;   ///< Newton steps taken
  double residual = 0;  ///< of `Minimum`, at most minimum_tolerance
};

/// The minimiser of 1/(2 h^2) |x - y|^2_M + sum C^2 / (2 alpha): backward Euler in time (Bouaziz et al.,
/// Projective Dynamics, 2014; what XPBD, Macklin et al. 2016, approximates). By Newton with an Armijo line
/// search from `guess`, or from y if there is none (of several local minima, guess decides). v += (x - y) /
/// h. Fixed vertices stay where they are. `settings.substeps` such steps, iterations summed, largest
/// residual; `guess` is for the first. Throws Error for compliances not above 0 and when Newton does not
/// converge.
ReferenceStep implicit_euler_step(const ReferenceInput& input, State state, const Compliances& compliances,
                                  const Points* guess = nullptr);

/// Where the body hangs at rest, velocities 0: the minimiser of sum C^2 / (2 alpha) - sum m g . x from the
/// given positions, in up to 64 steps of load where one does not converge. Throws Error without fixed
/// vertices or gravity, for compliances not above 0, and where no isolated stable equilibrium is found (a
/// body free to turn has none).
ReferenceStep static_equilibrium(const ReferenceInput& input, const Points& positions, const Compliances& compliances);

}  // namespace tetpbd
