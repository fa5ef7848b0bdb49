// The paper's GPU pipeline as published, the baseline of `bench`: predict, a dispatch per constraint kind with float
// atomics made of compare-and-swap, average, update, in work-groups of 1024.
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "sim/gl/layout.h"
#include "sim/solvers/jacobi.h"

namespace tetpbd {

namespace {

// Neighbours in one work-group would add to the same vertices and wait for each other: on an NVIDIA H200 an iteration
// on the bunny takes 1.16 times as long in TetGen's order, and 1.21 times along a curve.
ConstraintList shuffle(const ConstraintList& list) {
  std::vector<std::size_t> order(list.count());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  ConstraintList result;
  result.arity = list.arity;
  for (const std::size_t c : order) result.add(list, c);
  return result;
}

}  // namespace

Solver create_paper_solver(const SolverInput& input) {
  constexpr unsigned group = 1024;
  Solver solver;
  solver.quantized_buffers = 1;
  JacobiPasses jacobi{.unfused = true};
  const std::vector<Substitutions> kinds = kind_words(input.system);
  for (std::size_t k = 0, index = 0; k < kind_count; ++k) {
    if (!input.system.present[k]) continue;
    const std::size_t arity = std::size_t(constraint_kinds[k].arity), count = input.system.lists[k].count();
    Buffer records = record_buffer(shuffle(input.system.lists[k]), constraint_kinds[k].name);
    check_storage(input.tuning, records.label(), records.bytes());
    const std::size_t bytes = count * (4 * (arity + 1) + arity * (16 + 2 * 12));  // an atomic reads and writes
    std::vector<std::string> defines = quanta_defines(input);
    defines.push_back(fmt::format("GROUP_SIZE {}", group)), defines.push_back(fmt::format("COUNT {}", count));
    jacobi.passes.push_back({.program = Program::compute("solvers/paper.comp", {kinds[index++], {}}, defines),
                             .work_groups = work_groups(count, group),
                             .bytes = bytes,
                             .records = records.id()});
    solver.buffers.push_back(std::move(records));
  }
  jacobi.passes.push_back(make_average_pass(solver, input, group, true));
  add_jacobi(solver, input, std::move(jacobi));
  return solver;
}

}  // namespace tetpbd
