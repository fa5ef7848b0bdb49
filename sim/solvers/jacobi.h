// Jacobi on the GPU (method.md, "A step"): predict, solve x iterations, finish. Modes node, constraint and paper differ
// in the passes of an iteration; mode explicit uses the same patches of constraints.
#pragma once

#include "sim/solvers/patches.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// The passes of one iteration, in order; the last one moves the vertices.
struct JacobiPasses {
  std::vector<Pass> passes{};
  bool unfused = false;  ///< prediction and velocities have dispatches of their own
};
/// Makes the solver do Jacobi's substeps.
void add_jacobi(Solver& solver, const SolverInput& input, JacobiPasses passes);
/// Gives the solver the kernel that makes, after a change from outside, what neighbours see of the vertices.
void add_prediction(Solver& solver, const SolverInput& input);
/// A pass of `shader`, a work-group per patch. Gives the solver the patches' buffer (patch.glsl) and, where there is
/// compliance, a buffer of multipliers.
Pass make_patch_pass(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                     unsigned group, bool multipliers = true);
/// A pass whose work-groups each own a patch of vertices, as large as is best for the mesh, and gather all constraints
/// on these. Gives the solver what make_patch_pass() does, and two buffers of quantized positions.
Pass make_vertex_patch_pass(Solver& solver, const SolverInput& input, const char* shader, bool multipliers);
/// The pass that averages the sums of corrections and moves the vertices (average.comp). Gives the solver these sums,
/// at zero.
Pass make_average_pass(Solver& solver, const SolverInput& input, unsigned group, bool float_sums);

}  // namespace tetpbd
