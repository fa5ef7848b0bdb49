// Node-centric Jacobi: one dispatch an iteration, whatever the number of constraint kinds (paper algorithm 2).
#include "sim/layout.h"
#include "sim/solver.h"

namespace tetpbd {

Solver create_node_solver(const SolverInput& input) {
  Solver solver;
  solver.double_buffered = true;
  const auto kinds = kind_words(input.system);
  solver.buffers = record_buffers(input.system);
  Pass pass;
  pass.program = Program::compute("solve_node.comp", {{}, kinds});
  pass.groups = work_groups(input.model.positions.size(), 64);
  for (std::size_t k = 0; k < kinds.size(); ++k) pass.bindings.push_back({BIND_RECORDS + int(k), solver.buffers[k].id()});
  solver.buffers.emplace_back("adjacency", vertex_adjacency(input.system));
  pass.bindings.push_back({BIND_ADJACENCY, solver.buffers.back().id()});
  solver.iteration.push_back(std::move(pass));
  return solver;
}

}  // namespace tetpbd
