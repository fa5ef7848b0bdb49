// Node-centric Jacobi: one dispatch an iteration, whatever the number of constraint kinds (paper algorithm
// 2). Mode groups: the same, one dispatch a group of constraints.
#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "sim/error.h"
#include "sim/groups.h"
#include "sim/layout.h"
#include "sim/solver.h"

namespace tetpbd {

namespace {

// Lanes a vertex. A small mesh waits for its longest serial gather, so many; a large one fills the GPU
// anyway, so few; a software renderer runs them one after the other. By size, not by timing: the same mesh
// gives the same bits.
unsigned lanes_for(std::size_t vertices, bool software) {
  if (software) return 1;
  return vertices <= 15000 ? 16 : vertices <= 100000 ? 4 : 2;
}

// What a vertex reads of its constraints of one kind, one after the other (gather.glsl): the other vertices
// and the rest value, so that nothing is looked up through an index; group after group. `first[g * vertices
// + i]`: where vertex i's of group g begin.
struct Stream {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> words;  // arity of them an entry
};

Stream make_stream(const ConstraintList& list, const int* turned, std::size_t vertices, int groups,
                   const std::vector<std::uint8_t>& group) {
  const std::size_t arity = std::size_t(list.arity);
  Stream stream;
  const auto row = [&](std::size_t c, std::size_t j) {
    return group[c] * vertices + list.vertices[c * arity + j];
  };
  stream.first.assign(std::size_t(groups) * vertices + 1, 0);
  for (std::size_t c = 0; c < list.count(); ++c)
    for (std::size_t j = 0; j < arity; ++j) ++stream.first[row(c, j) + 1];
  for (std::size_t r = 0; r + 1 < stream.first.size(); ++r) stream.first[r + 1] += stream.first[r];
  std::vector<std::uint32_t> next(stream.first.begin(), stream.first.end() - 1);
  stream.words.resize(list.vertices.size() * arity);
  for (std::size_t c = 0; c < list.count(); ++c)
    for (std::size_t j = 0; j < arity; ++j) {
      std::uint32_t* entry = stream.words.data() + next[row(c, j)]++ * arity;
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

Solver create(const SolverInput& input, int groups, bool grouped) {
  Solver solver;
  solver.double_buffered = true;
  solver.groups = groups;
  const auto kinds = kind_words(input.system);
  const std::size_t vertices = input.model.positions.size();
  // No more than a vertex has constraints of a kind in a group: the rest would idle.
  std::size_t most = 1;
  for (const ConstraintList& list : input.system.lists)
    if (grouped) most = std::max(most, list.vertices.size() / (vertices * std::size_t(groups)));
  const unsigned fitting = grouped ? unsigned(std::bit_ceil(most)) : 1024;
  const unsigned lanes =
      input.tuning.lanes ? input.tuning.lanes : std::min(lanes_for(vertices, input.software), fitting);
  const unsigned group = input.tuning.group ? input.tuning.group : 64;
  if (!std::has_single_bit(lanes) || lanes > group || !std::has_single_bit(group) || group > 1024)
    throw Error("lanes and group do not fit", fmt::format("{} lanes, work-groups of {}", lanes, group),
                "powers of two, lanes no more than a work-group, which has at most 1024");
  if (vertices >> 30)
    throw Error("too many vertices", fmt::format("{} of them", vertices), "use a smaller mesh");
  // A row ends where the next one begins, also from one group to the next.
  const std::size_t rows = vertices * std::size_t(groups) + 1;
  std::vector<std::uint32_t> table(rows * kinds.size());
  std::vector<std::vector<std::uint8_t>> members;
  if (groups > 1) members = balanced_groups(input.system, groups);
  std::size_t index = 0, entries = 0, neighbours = 0;
  for (std::size_t k = 0; k < input.system.lists.size(); ++k) {
    if (!input.system.present[k]) continue;
    const ConstraintList& list = input.system.lists[k];
    const Stream stream = make_stream(list, constraint_kinds()[k].turned, vertices, groups,
                                      groups > 1 ? members[k] : std::vector<std::uint8_t>(list.count()));
    for (std::size_t r = 0; r < rows; ++r) table[r * kinds.size() + index] = stream.first[r];
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
                              {"GROUPED", grouped ? "1" : "0"},
                              {"COUNT_GUARDS", input.tuning.count_guards ? "1" : "0"}},
                             kinds};
  Pass pass;
  pass.program = Program::compute("solve_node.comp", words);
  pass.groups = work_groups(vertices * lanes, group);
  // Position there and back, its place there and back, two rows of the table; a group's share of the entries
  // and of the neighbours' places.
  pass.bytes = vertices * (2 * sizeof(Position) + 2 * 16 + 8 * kinds.size()) +
               (entries + 16 * neighbours) / std::size_t(groups);
  solver.iteration.push_back(std::move(pass));
  return solver;
}

}  // namespace

Solver create_node_solver(const SolverInput& input) { return create(input, 1, false); }
Solver create_groups_solver(const SolverInput& input) { return create(input, input.groups, true); }

}  // namespace tetpbd
