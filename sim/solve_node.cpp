// Node-centric Jacobi: one dispatch an iteration, whatever the number of constraint kinds (paper algorithm
// 2).
#include "sim/layout.h"
#include "sim/solver.h"

namespace tetpbd {

namespace {

constexpr std::size_t group_size = 64;

// Lanes a vertex. A small mesh waits for its longest serial gather, so many; a large one fills the GPU
// anyway, so few; a software renderer runs them one after the other. By size, not by timing: the same mesh
// gives the same bits.
std::size_t lanes_for(std::size_t vertices, bool software) {
  if (software) return 1;
  return vertices <= 15000 ? 16 : vertices <= 60000 ? 8 : 4;
}

}  // namespace

Solver create_node_solver(const SolverInput& input) {
  Solver solver;
  solver.double_buffered = true;
  const auto kinds = kind_words(input.system);
  solver.buffers = record_buffers(input.system);
  const std::size_t vertices = input.model.positions.size(), lanes = lanes_for(vertices, input.software);
  Pass pass;
  pass.program = Program::compute("solve_node.comp", {{{"LANES", std::to_string(lanes)}, {"COUNT_GUARDS", input.count_guards ? "1" : "0"}}, kinds});
  pass.groups = work_groups(vertices * lanes, group_size);
  for (std::size_t k = 0; k < kinds.size(); ++k)
    pass.bindings.push_back({BIND_RECORDS + int(k), solver.buffers[k].id()});
  solver.buffers.emplace_back("adjacency", vertex_adjacency(input.system));
  pass.bindings.push_back({BIND_ADJACENCY, solver.buffers.back().id()});
  // Two offsets, itself, predicted, velocity and the write; for each entry the entry, its record and that
  // record's vertices.
  pass.bytes = vertices * (3 * sizeof(Position) + sizeof(Velocity) + 8 * kinds.size());
  for (std::size_t k = 0; k < input.system.lists.size(); ++k) {
    const ConstraintList& list = input.system.lists[k];
    if (input.system.present[k])
      pass.bytes += list.vertices.size() *
                    (4 + 4 * std::size_t(list.arity + 1) + std::size_t(list.arity) * sizeof(Position));
  }
  solver.iteration.push_back(std::move(pass));
  return solver;
}

}  // namespace tetpbd
