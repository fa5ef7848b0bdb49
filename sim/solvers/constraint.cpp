// Constraint-centric Jacobi (paper algorithm 3): one dispatch for the constraints of all kinds, a work-group
// per patch of them, then one that averages.
#include "sim/solvers/solver.h"

namespace tetpbd {

Solver create_constraint_solver(const SolverInput& input) {
  Solver solver;
  // A small mesh needs patches for every part of the GPU.
  const Cut cut = tuned({input.system.count() <= 150000 ? 128u : 256u, 128}, input.tuning);
  const Patches patches = constraint_patches(input.system, cut.patch);
  if (patches.count > 0) {
    add_patches(solver, input, patches, "solve_constraint.comp", cut.group);
    solver.iteration.back().bytes += patches.vertices.size() * 2 * 12;  // an atomic reads and writes
  }
  add_average(solver, input, 256, false);
  return solver;
}

}  // namespace tetpbd
