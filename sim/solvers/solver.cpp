#include "sim/solvers/solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdlib>

#include "sim/contact/obstacles.h"
#include "sim/contact/pairs.h"
#include "sim/error.h"
#include "sim/gl/layout.h"
#include "sim/parallel.h"
#include "sim/solvers/patches.h"

namespace tetpbd {

// Declares the function that the file of a mode has, and calls it.
#define MADE_BY(function)                \
  [](const SolverInput& input) {         \
    Solver function(const SolverInput&); \
    return function(input);              \
  }

static const std::vector<SolverMode> rows = {
    {.name = "node",
     .help = "XPBD (Jacobi) on the GPU, node-centric, one dispatch per iteration: for hard bodies and k below 1",
     .create = MADE_BY(create_node_solver),
     .pairs = true,
     .jacobi = true},
    {.name = "constraint",
     .help = "the same, constraint-centric with integer atomics: as accurate, usually slower",
     .create = MADE_BY(create_constraint_solver),
     .pairs = true,
     .jacobi = true},
    {.name = "gauss-seidel",
     .help = "XPBD (Gauss-Seidel by colours) on the GPU: fewer iterations than Jacobi, more dispatches",
     .create = MADE_BY(create_gauss_seidel_solver),
     .pairs = true,
     .in_place = true},
    {.name = "cpu",
     .help = "XPBD (Gauss-Seidel) on one CPU core: the paper's baseline",
     .create = MADE_BY(create_cpu_solver),
     .pairs = true,
     .cpu = true},
    {.name = "cpu-double",
     .help = "the same in double precision: the reference for stability",
     .create = MADE_BY(create_cpu_double_solver),
     .pairs = true,
     .cpu = true},
    {.name = "cpu-fast",
     .help = "XPBD (Gauss-Seidel by colours) on all CPU cores, vectorized: for machines without a GPU",
     .create = MADE_BY(create_cpu_fast_solver),
     .pairs = true,
     .cpu = true,
     .all_cores = true},
    {.name = "explicit",
     .help = "leapfrog on the GPU, for bodies with a material or compliance, in as many substeps as stability needs: "
             "for soft bodies",
     .create = MADE_BY(create_explicit_solver),
     .forces = true,
     .leapfrog = true,
     .pairs = true,
     .smoothed = true,
     .substeps = 1},
    {.name = "newton",
     .help = "implicit steps (BDF2, Newton with two-level conjugate gradients) on the GPU, for bodies with a material "
             "or compliance: for stiff bodies, small tets or a badly deformed start",
     .create = MADE_BY(create_newton_solver),
     .forces = true,
     .implicit = true,
     .pairs = true,
     .smoothed = true,
     .iterations = 4,
     .substeps = 1},
    {.name = "vbd",
     .help = "implicit Euler by Vertex Block Descent on the GPU, for bodies with a material or compliance: sweeps over "
             "colours of vertices",
     .create = MADE_BY(create_vbd_solver),
     .forces = true,
     .pairs = true,
     .accelerates = true,
     .iterations = 20,
     .substeps = 4},
    {.name = "paper",
     .help = "the paper's GPU pipeline: a kernel per kind, floats added by compare-and-swap",
     .create = MADE_BY(create_paper_solver),
     .compliance = false,
     .jacobi = true,
     .published = true,
     .offered = false},
};

const std::vector<SolverMode>& solver_modes() {
  static const std::vector<SolverMode> offered = [] {
    std::vector<SolverMode> some;
    std::ranges::copy_if(rows, std::back_inserter(some), &SolverMode::offered);
    return some;
  }();
  return offered;
}

const SolverMode* find_solver_mode(const std::string& name) {
  const auto row = std::ranges::find(rows, name, &SolverMode::name);
  return row == rows.end() ? nullptr : &*row;
}

Plan plan_for(const Settings& s) {
  const SolverMode& mode = solver_mode(s);
  Plan plan{s.substeps == automatic ? mode.substeps : s.substeps,
            s.iterations == automatic || mode.leapfrog ? mode.iterations : s.iterations};
  plan.h = s.dt / plan.substeps;
  return plan;
}

const SolverMode& solver_mode(const Settings& settings) {
  static const SolverMode baseline{};
  const SolverMode* mode = find_solver_mode(settings.mode);
  return mode ? *mode : baseline;
}

Tuning tuning_from_environment() {
  Tuning tuning;
  const char* variable = std::getenv("TETPBD_TUNE");
  for (const std::string& assignment : split(variable ? variable : "", ',')) {
    unsigned* target = nullptr;
    for (const auto& [name, member] : {std::pair("group=", &tuning.group), std::pair("patch=", &tuning.patch),
                                       std::pair("row=", &tuning.row), std::pair("threads=", &tuning.threads)})
      if (assignment.starts_with(name)) target = member;
    const char* end = assignment.data() + assignment.size();
    const char* number = assignment.data() + std::min(assignment.find('=') + 1, assignment.size());
    if (!target || std::from_chars(number, end, *target).ptr != end)
      throw Error(fmt::format("'{}' is no tuning", assignment), "TETPBD_TUNE",
                  "write group=N, patch=N, row=N or threads=N, separated by commas");
  }
  return tuning;
}

std::string define(const char* name, std::size_t value) { return fmt::format("{} {}", name, value); }

std::vector<Substitutions> kind_words(const ConstraintSystem& system) {
  std::vector<Substitutions> words;
  for (std::size_t k = 0; k < kind_count; ++k) {
    if (!system.present[k]) continue;
    const ConstraintKind& kind = constraint_kinds[k];
    const ConstraintList& list = system.lists[k];
    words.push_back({{"KIND", kind.name},
                     {"ARITY", std::to_string(kind.arity)},
                     {"INDEX", std::to_string(words.size())},
                     {"PAIRS", std::to_string(record_pairs(list))},
                     {"MATERIAL", list.compliance.empty() ? "0" : "1"},
                     {"OWN", list.stiffness.empty() ? "0" : "1"},
                     {"PROJECT", kind.components == 1 ? "project" : "project_two"},
                     {"RATE", kind.rate ? "1" : "0"},
                     {"AVERAGED", kind.averaged ? "1" : "0"},
                     {"VALUES", std::to_string(kind.values)},
                     {"COMPONENTS", std::to_string(kind.components)},
                     {"CURVED", kind.curved ? "1" : "0"},
                     {"TETS", kind.tet ? "1" : "0"},
                     {"DRIVEN", kind.driven ? "1" : "0"},
                     {"KIND_ROW", std::to_string(k / 4)},
                     {"KIND_COLUMN", std::to_string(k % 4)}});
  }
  return words;
}

ShaderWords scheme_words(const SolverInput& input) {
  return {{{"SCHEME", solver_mode(input.settings).leapfrog ? "leapfrog" : "corrections"}}, {}};
}

std::vector<std::string> quanta_defines(const SolverInput& input) {
  return input.fine_quanta ? std::vector<std::string>{"BODY_QUANTA 1"} : std::vector<std::string>{};
}

std::vector<std::string> vertex_defines(const SolverInput& input) {
  const SolverMode& mode = solver_mode(input.settings);
  std::vector<std::string> defines = obstacle_defines(input.model, has_own_surfaces(input.settings));
  std::ranges::move(quanta_defines(input), std::back_inserter(defines));
  defines.insert(defines.end(), {define("COMPLIANT", input.compliant), define("LEAPFROG", mode.leapfrog),
                                 define("QUANTIZED", !mode.in_place && !mode.implicit),
                                 define("RIGID_CONTACT", input.rigid), define("BODY_COUNT", input.model.bodies.size()),
                                 define("CONTACTS", bodies_touch(input.model, input.settings))});
  return defines;
}

Buffer record_buffer(const ConstraintList& list, const std::string& kind) {
  const std::size_t arity = std::size_t(list.arity), row = arity + 1;
  std::vector<std::uint32_t> words(list.count() * row);
  parallel_for(list.count(), [&](std::size_t c) {
    std::copy_n(list.vertices.data() + c * arity, arity, words.data() + c * row);
    words[c * row + arity] = std::bit_cast<std::uint32_t>(float(list.rest[c]));
  });
  return Buffer("records " + kind, words);
}

void check_storage(const Tuning& tuning, const std::string& label, std::size_t bytes) {
  if (tuning.storage > 0) check_block(label, bytes, tuning.storage);
}

void add_buffer(Solver& solver, const Tuning& tuning, const char* block, Buffer buffer) {
  check_storage(tuning, buffer.label(), buffer.bytes());
  solver.bindings.emplace_back(block, buffer.id());
  solver.buffers.push_back(std::move(buffer));
}

Cut tuned(Cut cut, const Tuning& tuning) {
  if (tuning.patch) cut.patch = tuning.patch;
  if (tuning.group) cut.group = tuning.group;
  if (!std::has_single_bit(cut.group) || cut.group > 1024)
    throw Error("no such work-group", fmt::format("{} invocations", cut.group), "a power of two up to 1024");
  return cut;
}

}  // namespace tetpbd
