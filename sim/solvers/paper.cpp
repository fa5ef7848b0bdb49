// The paper's GPU pipeline as published, the baseline of `bench`: predict, a dispatch a constraint kind with
// float atomics made of compare-and-swap, average, update; work-groups of 1024; one thread a vertex.
#include "sim/error.h"
#include "sim/layout.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

Solver create_paper_solver(const SolverInput& input) {
  if (input.compliant)
    throw Error("mode paper has no compliance", "compliance and constraint_damping above 0",
                "set them to 0 or use mode constraint");
  constexpr unsigned group = 1024;
  Solver solver;
  solver.separate = true;
  solver.buffers = record_buffers(input.system);
  std::size_t index = 0;
  for (Substitutions words : kind_words(input.system)) {
    const std::size_t arity = std::stoul(words.at("ARITY"));
    const std::size_t count = solver.buffers[index].bytes() / (4 * (arity + 1));
    check_storage(input.tuning, solver.buffers[index].label(), solver.buffers[index].bytes());
    words["GROUP"] = std::to_string(group);
    words["COUNT"] = std::to_string(count);
    const std::size_t bytes =
        count * (4 * (arity + 1) + arity * (16 + 2 * 12));  // an atomic reads and writes
    solver.bindings.push_back({BIND_RECORDS + int(index), solver.buffers[index].id()});
    solver.iteration.push_back(
        {Program::compute("solve_paper.comp", {words, {}}), work_groups(count, group), bytes});
    ++index;
  }
  add_average(solver, input, group, true);
  return solver;
}

}  // namespace tetpbd
