// Node-centric Jacobi: one dispatch an iteration, whatever the number of constraint kinds (paper algorithm
// 2). Mode groups: the same, one dispatch a group of constraints.
#include <fmt/format.h>

#include <algorithm>

#include "sim/error.h"
#include "sim/solvers/groups.h"
#include "sim/layout.h"
#include "sim/solvers/patches.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

// How vertices are cut into work-groups: by size, not by timing, so that the same mesh is always cut alike. A
// small mesh needs a patch for every part of the GPU, and an invocation for each of its constraints; a large
// one gains from large patches, in which fewer constraints belong to two, and from small work-groups, of
// which a part of the GPU runs many.
// With handles a kernel holds more, and no more work-groups than a GPU runs at once should wait for their
// poses.
Cut cut_for(std::size_t vertices, bool software, bool handles) {
  if (software) return {64, 64};
  if (handles && vertices <= 4000) return {32, 512};
  if (handles && vertices <= 8000) return {56, 512};
  if (handles && vertices <= 14000) return {48, 256};
  if (handles) return {64, 256};
  if (vertices <= 4000) return {16, 512};
  if (vertices <= 8000) return {16, 256};
  if (vertices <= 14000) return {24, 256};
  if (vertices <= 30000) return {48, 256};
  return {64, 128};
}

Solver create(const SolverInput& input, bool grouped) {
  const std::size_t vertices = input.model.positions.size();
  const bool held = input.handles && !grouped;
  const Cut cut = tuned(cut_for(vertices, input.software, held), input.tuning);
  if (cut.patch > std::min<std::size_t>(cut.group, Patches::most_vertices - 4))
    throw Error("a patch does not fit a work-group",
                fmt::format("{} vertices, work-groups of {}", cut.patch, cut.group),
                "an invocation for each vertex, 252 at most");
  Solver solver;
  solver.double_buffered = true;
  solver.groups = grouped ? input.groups : 1;
  const Patches patches = grouped ? vertex_patches(input.system, cut.patch, input.groups,
                                                   balanced_groups(input.system, input.groups))
                                  : vertex_patches(input.system, cut.patch);
  if (held) solver.handles = build_handles(input.model);
  add_patches(solver, input, patches, "solve_node.comp", cut.group, grouped,
              held ? &solver.handles : nullptr);
  solver.iteration.back().bytes += vertices * (2 * sizeof(Position) + 16);
  return solver;
}

}  // namespace

Solver create_node_solver(const SolverInput& input) { return create(input, false); }
Solver create_groups_solver(const SolverInput& input) { return create(input, true); }

}  // namespace tetpbd
