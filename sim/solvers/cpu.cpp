// Non-linear Gauss-Seidel on one CPU core (method.md eq. 16): in float the paper's baseline, in double what stability
// is compared with.
#include <memory>

#include "sim/sim.h"
#include "sim/solvers/cpu_pbd.h"

namespace tetpbd {

namespace {

template <class real>
Solver create(const SolverInput& input) {
  Solver solver;
  const auto pbd = std::make_shared<CpuPbd<real>>(input.model, input.system);
  solver.substep = [pbd](Sim& sim, int) {
    pbd->change_model(*sim.model);
    add_guards(sim, pbd->step(sim.host, sim.settings, sim.inverse_masses, Sweep::gauss_seidel, simulated_time(sim)));
  };
  return solver;
}

}  // namespace

Solver create_cpu_solver(const SolverInput& input) { return create<float>(input); }
Solver create_cpu_double_solver(const SolverInput& input) { return create<double>(input); }

}  // namespace tetpbd
