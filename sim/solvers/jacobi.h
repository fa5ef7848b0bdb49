// Jacobi on the GPU (method.md, "A step"): predict, solve x iterations, finish. Modes node, constraint and
// paper differ in the passes of an iteration; mode explicit shares their patches of constraints.
#pragma once

#include "sim/solvers/patches.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// Of one iteration, in order; the last one moves the vertices.
struct JacobiPasses {
  std::vector<Pass> passes{};
  bool unfused = false;  ///< prediction and velocities in dispatches of their own
};
/// Gives a solver what Jacobi does.
void add_jacobi(Solver& solver, const SolverInput& input, JacobiPasses passes);
/// Where every vertex will be after prediction: needed after a change from outside.
void add_prediction(Solver& solver, const SolverInput& input);
/// A pass of `shader`, a work-group per patch; gives the solver the patches' buffers (patch.glsl), and with
/// compliance room for multipliers.
Pass make_patch_pass(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                     unsigned group, bool multipliers = true);
/// The last pass of an iteration of constraints, which averages the sums of corrections and moves the
/// vertices (average.comp); gives the solver these sums, at zero.
Pass make_average_pass(Solver& solver, const SolverInput& input, unsigned group, bool float_sums);

}  // namespace tetpbd
