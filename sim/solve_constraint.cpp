// Constraint-centric Jacobi: a dispatch a constraint kind, then one that averages (paper algorithm 3).
#include "sim/layout.h"
#include "sim/solver.h"

namespace tetpbd {

Solver create_constraint_solver(const SolverInput& input) {
  Solver solver;
  solver.buffers = record_buffers(input.system);
  Buffer deltas("deltas", input.model.positions.size() * 16);
  deltas.clear();
  std::size_t index = 0;
  for (Substitutions words : kind_words(input.system)) {
    words["COUNT_GUARDS"] = input.count_guards ? "1" : "0";
    const std::size_t count = solver.buffers[index].bytes() / (4 * (std::stoul(words.at("ARITY")) + 1));
    Pass pass;
    pass.program = Program::compute("solve_constraint.comp", {words, {}});
    pass.program.use();
    pass.program.set("count", unsigned(count));
    pass.groups = work_groups(count, 256);
    const std::size_t arity = std::stoul(words.at("ARITY"));  // an atomic reads and writes
    pass.bytes = count * (4 * (arity + 1) + arity * (sizeof(Position) + 2 * 12));
    pass.bindings = {{BIND_DELTAS, deltas.id()}, {BIND_RECORDS + int(index), solver.buffers[index].id()}};
    solver.iteration.push_back(std::move(pass));
    ++index;
  }
  Pass average;
  average.program = Program::compute("average.comp");
  average.groups = work_groups(input.model.positions.size(), 256);
  average.bytes = input.model.positions.size() * (3 * sizeof(Position) + sizeof(Velocity) + 2 * 16);
  average.bindings = {{BIND_DELTAS, deltas.id()}};
  solver.iteration.push_back(std::move(average));
  solver.buffers.push_back(std::move(deltas));
  return solver;
}

}  // namespace tetpbd
