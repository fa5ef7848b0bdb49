// Node-centric Jacobi: one dispatch an iteration, whatever the number of constraint kinds (paper algorithm
// 2).
#include <fmt/format.h>

#include <bit>

#include "sim/error.h"
#include "sim/layout.h"
#include "sim/solver.h"

namespace tetpbd {

namespace {

// Lanes a vertex. A small mesh waits for its longest serial gather, so many; a large one fills the GPU
// anyway, so few; a software renderer runs them one after the other. By size, not by timing: the same mesh
// gives the same bits.
unsigned lanes_for(std::size_t vertices, bool software) {
  if (software) return 1;
  return vertices <= 15000 ? 16 : vertices <= 60000 ? 8 : 4;
}

// What a vertex reads of its constraints of one kind, one after the other (gather.glsl): the other vertices
// and the rest value, so that nothing is looked up through an index. `first[i]`: where vertex i's begin.
struct Stream {
  std::vector<std::size_t> first;
  std::vector<std::uint32_t> words;  // arity of them an entry
};

Stream make_stream(const ConstraintList& list, const int* turned, std::size_t vertices) {
  const std::size_t arity = std::size_t(list.arity);
  Stream stream;
  stream.first.assign(vertices + 1, 0);
  for (std::uint32_t v : list.vertices) ++stream.first[v + 1];
  for (std::size_t i = 0; i < vertices; ++i) stream.first[i + 1] += stream.first[i];
  std::vector<std::size_t> next(stream.first.begin(), stream.first.end() - 1);
  stream.words.resize(list.vertices.size() * arity);
  for (std::size_t c = 0; c < list.count(); ++c)
    for (std::size_t j = 0; j < arity; ++j) {
      std::uint32_t* entry = stream.words.data() + next[list.vertices[c * arity + j]]++ * arity;
      std::uint32_t slot = 0, others = 0;
      for (std::size_t k = 0; k < arity; ++k) {
        const std::size_t from = turned ? std::size_t(turned[j * arity + k]) : k;
        if (from == j)
          slot = std::uint32_t(k);
        else
          entry[others++] = list.vertices[c * arity + from];
      }
      entry[0] |= slot << 30;
      entry[arity - 1] = std::bit_cast<std::uint32_t>(float(list.rest[c]));
    }
  return stream;
}

}  // namespace

Solver create_node_solver(const SolverInput& input) {
  Solver solver;
  solver.double_buffered = true;
  const auto kinds = kind_words(input.system);
  const std::size_t vertices = input.model.positions.size();
  const unsigned lanes = input.tuning.lanes ? input.tuning.lanes : lanes_for(vertices, input.software);
  const unsigned group = input.tuning.group ? input.tuning.group : 64;
  if (!std::has_single_bit(lanes) || lanes > group || !std::has_single_bit(group) || group > 1024)
    throw Error("lanes and group do not fit", fmt::format("{} lanes, work-groups of {}", lanes, group),
                "powers of two, lanes no more than a work-group, which has at most 1024");
  if (vertices >> 30)
    throw Error("too many vertices", fmt::format("{} of them", vertices), "use a smaller mesh");
  std::vector<std::uint32_t> table((vertices + 1) * kinds.size());
  std::size_t index = 0, entries = 0, neighbours = 0;
  for (std::size_t k = 0; k < input.system.lists.size(); ++k) {
    if (!input.system.present[k]) continue;
    const ConstraintList& list = input.system.lists[k];
    const Stream stream = make_stream(list, constraint_kinds()[k].turned, vertices);
    for (std::size_t i = 0; i <= vertices; ++i)
      table[i * kinds.size() + index] = std::uint32_t(stream.first[i]);
    solver.buffers.push_back(
        storage_buffer(input.tuning, std::string("stream ") + constraint_kinds()[k].name, stream.words));
    solver.bindings.push_back({BIND_STREAMS + int(index), solver.buffers.back().id()});
    entries += solver.buffers.back().bytes();
    neighbours += list.vertices.size() * std::size_t(list.arity - 1);
    ++index;
  }
  solver.buffers.push_back(storage_buffer(input.tuning, "stream table", table));
  solver.bindings.push_back({BIND_TABLE, solver.buffers.back().id()});
  const ShaderWords words = {{{"LANES", std::to_string(lanes)},
                              {"GROUP", std::to_string(group)},
                              {"KINDS", std::to_string(kinds.size())},
                               {"COUNT_GUARDS", input.tuning.count_guards ? "1" : "0"}},
                             kinds};
  Pass pass;
  pass.program = Program::compute("solve_node.comp", words);
  pass.groups = work_groups(vertices * lanes, group);
  // Position there and back, its place there and back, two rows of the table; entries; the neighbours'
  // places.
  pass.bytes = vertices * (2 * sizeof(Position) + 2 * 16 + 8 * kinds.size()) + entries + 16 * neighbours;
  solver.iteration.push_back(std::move(pass));
  return solver;
}

}  // namespace tetpbd
