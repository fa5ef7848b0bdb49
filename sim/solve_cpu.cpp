// Non-linear Gauss-Seidel on one CPU core, float (method.md eq. 15): the paper's baseline, with contiguous
// constraints and everything inlined.
#include <memory>

#include "sim/cpu_pbd.h"

namespace tetpbd {

Solver create_cpu_solver(const SolverInput& input) {
  Solver solver;
  solver.step_on_cpu = [pbd = std::make_shared<CpuPbd<float>>(input.model, input.system)](
                           State& state, const Settings& settings,
                           const std::vector<double>& inverse_masses) {
    pbd->step(state, settings, inverse_masses, Sweep::gauss_seidel);
  };
  return solver;
}

}  // namespace tetpbd
