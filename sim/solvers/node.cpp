// Node-centric Jacobi: one dispatch per iteration, whatever the number of constraint kinds (paper algorithm 2).
#include <fmt/format.h>

#include <algorithm>

#include "sim/contact/moving_obstacle.h"
#include "sim/contact/pairs.h"
#include "sim/error.h"
#include "sim/gl/layout.h"
#include "sim/solvers/jacobi.h"

namespace tetpbd {

namespace {

// How vertices are cut into work-groups, by size and not by timing, so that the same mesh is always cut alike. A small
// mesh needs a patch for every part of the GPU, and an invocation for each constraint. A large one gains from large
// patches, which share fewer constraints. What is `light`, one material's kernel, leaves registers for large
// work-groups side by side; hard bodies with all kinds do not, and take small ones.
Cut choose_cut(std::size_t vertices, bool solids, bool software, bool light) {
  if (software) return {64, 64};
  // A kernel that knows more than planes needs so many registers that fewer work-groups run side by side.
  if (solids && vertices <= 4000) return {32, 512};
  if (solids && vertices <= 14000) return {32, 256};
  if (vertices <= 4000) return {16, 512};
  if (vertices <= 8000) return {16, 256};
  if (vertices <= 14000) return {24, 256};
  if (light) return vertices <= 50000 ? Cut{96, 512} : vertices <= 120000 ? Cut{64, 256} : Cut{96, 256};
  return vertices <= 30000 ? Cut{48, 256} : Cut{64, 128};
}

}  // namespace

Pass make_vertex_patch_pass(Solver& solver, const SolverInput& input, const char* shader, bool multipliers) {
  const std::size_t vertices = input.model.positions.size();
  const bool solids = !solid_obstacles(input.model).empty(),
             light = !input.rigid && !solids && !bodies_touch(input.model, input.settings) &&
                     std::ranges::count(input.system.present, true) <= 2;
  const Cut cut = tuned(choose_cut(vertices, solids, input.software, light), input.tuning);
  if (cut.patch > std::min<std::size_t>(cut.group, Patches::most_vertices - 4))
    throw Error("a patch does not fit a work-group",
                fmt::format("{} vertices, work-groups of {}", cut.patch, cut.group),
                "an invocation for each vertex, 252 at most");
  solver.quantized_buffers = 2;
  Pass pass =
      make_patch_pass(solver, input, vertex_patches(input.system, cut.patch, any_material(input.settings, yields)),
                      shader, cut.group, multipliers);
  pass.bytes += vertices * (2 * sizeof(Position) + 16);
  solver.vertex_patches = pass.work_groups;
  return pass;
}

Solver create_node_solver(const SolverInput& input) {
  Solver solver;
  JacobiPasses jacobi;
  jacobi.passes.push_back(make_vertex_patch_pass(solver, input, "solvers/node.comp", true));
  add_jacobi(solver, input, std::move(jacobi));
  return solver;
}

}  // namespace tetpbd
