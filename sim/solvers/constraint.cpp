// Constraint-centric Jacobi (paper algorithm 3): one dispatch for the constraints of all kinds, with a work-group per
// patch of them, then one that averages.
#include "sim/solvers/jacobi.h"

namespace tetpbd {

Solver create_constraint_solver(const SolverInput& input) {
  Solver solver;
  solver.quantized_buffers = 1;
  JacobiPasses jacobi;
  // A small mesh needs patches for every part of the GPU.
  const Cut cut = tuned({input.system.count() <= 150000 ? 128u : 256u, 128}, input.tuning);
  const Patches patches = constraint_patches(input.system, cut.patch, any_material(input.settings, yields));
  if (patches.count > 0) {
    jacobi.passes.push_back(make_patch_pass(solver, input, patches, "solvers/constraint.comp", cut.group));
    jacobi.passes.back().bytes += patches.vertices.size() * 2 * 12;  // an atomic reads and writes
  }
  jacobi.passes.push_back(make_average_pass(solver, input, 256, false));
  add_jacobi(solver, input, std::move(jacobi));
  return solver;
}

}  // namespace tetpbd
