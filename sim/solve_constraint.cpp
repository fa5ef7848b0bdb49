// Constraint-centric Jacobi (paper algorithm 3): one dispatch for the constraints of all kinds, a work-group
// a patch of them, then one that averages.
#include <fmt/format.h>

#include <bit>

#include "sim/error.h"
#include "sim/layout.h"
#include "sim/patches.h"
#include "sim/solver.h"

namespace tetpbd {

namespace {

// Constraints of a patch. A small mesh needs patches for every part of the GPU; a large one gains from large
// patches, whose vertices are read and added to once.
std::size_t patch_for(std::size_t constraints) { return constraints <= 200000 ? 256 : 512; }

}  // namespace

Solver create_constraint_solver(const SolverInput& input) {
  Solver solver;
  const auto kinds = kind_words(input.system);
  const unsigned group = input.tuning.group ? input.tuning.group : 128;
  if (!std::has_single_bit(group) || group > 1024)
    throw Error("no such work-group", fmt::format("{} invocations", group), "a power of two up to 1024");
  if (!kinds.empty()) {
    const Patches patches = make_patches(
        input.model, input.system, input.tuning.patch ? input.tuning.patch : patch_for(input.system.count()));
    Pass pass;
    pass.program =
        Program::compute("solve_constraint.comp", {{{"GROUP", std::to_string(group)},
                                                    {"KINDS", std::to_string(kinds.size())},
                                                    {"COUNT_GUARDS", input.tuning.count_guards ? "1" : "0"}},
                                                   kinds});
    pass.program.use();
    pass.program.set("patch_count", unsigned(patches.count));
    pass.groups = patches.count;
    // A patch's vertices twice and their places; its records; an atomic reads and writes.
    pass.bytes = patches.vertices.size() * (2 * 8 + 16 + 2 * 12) + patches.records.size() * 8 +
                 patches.rows.size() * 8;
    solver.iteration.push_back(std::move(pass));
    solver.buffers.push_back(storage_buffer(input.tuning, "patches", patches.rows));
    solver.bindings.push_back({BIND_PATCHES, solver.buffers.back().id()});
    solver.buffers.push_back(storage_buffer(input.tuning, "patch vertices", patches.vertices));
    solver.bindings.push_back({BIND_PATCH_VERTICES, solver.buffers.back().id()});
    solver.buffers.push_back(storage_buffer(input.tuning, "patch records", patches.records));
    solver.bindings.push_back({BIND_PATCH_RECORDS, solver.buffers.back().id()});
  }
  add_average(solver, input, 256, false);
  return solver;
}

}  // namespace tetpbd
