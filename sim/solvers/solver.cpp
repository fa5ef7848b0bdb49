#include "sim/solvers/solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdlib>

#include "sim/error.h"
#include "sim/layout.h"
#include "sim/pairs.h"
#include "sim/parallel.h"

namespace tetpbd {

// Each in the file of its mode.
Solver create_node_solver(const SolverInput&);
Solver create_constraint_solver(const SolverInput&);
Solver create_cpu_solver(const SolverInput&);
Solver create_cpu_double_solver(const SolverInput&);
Solver create_cpu_fast_solver(const SolverInput&);
Solver create_newton_solver(const SolverInput&);
Solver create_paper_solver(const SolverInput&);

namespace {

const std::vector<SolverMode> rows = {
    {.name = "node",
     .help = "Jacobi on the GPU, a vertex gathers all its constraints in one dispatch: for hard bodies and k "
             "below 1",
     .create = create_node_solver,
     .pairs = true},
    {.name = "constraint",
     .help =
         "Jacobi on the GPU, a constraint adds to its vertices with integer atomics: as right, mostly slower",
     .create = create_constraint_solver,
     .pairs = true},
    {.name = "cpu",
     .help = "non-linear Gauss-Seidel on one CPU core: the paper's baseline",
     .create = create_cpu_solver,
     .pairs = true},
    {.name = "cpu-double",
     .help = "the same in double precision: what stability is held against",
     .create = create_cpu_double_solver,
     .pairs = true},
    {.name = "cpu-fast",
     .help = "Gauss-Seidel by colours on all CPU cores, with vector instructions: for machines without a GPU",
     .create = create_cpu_fast_solver,
     .pairs = true},
    {.name = "explicit",
     .help = "leapfrog on the GPU, of what has a material or compliance, in as many substeps as stay stable: "
             "for what is soft",
     .create = create_node_solver,
     .leapfrog = true,
     .pairs = true,
     .substeps = 1},
    {.name = "newton",
     .help = "implicit steps on the GPU, of what has a material or compliance, by conjugate gradients on two "
             "levels: for what is stiff, has small tets or starts badly deformed",
     .create = create_newton_solver,
     .implicit = true,
     .pairs = true,
     .iterations = 4,
     .substeps = 1},
    {.name = "paper",
     .help = "the paper's GPU pipeline: a kernel per kind, floats added by compare-and-swap",
     .create = create_paper_solver,
     .compliance = false,
     .offered = false},
};

std::string define(const char* name, std::size_t value) { return fmt::format("{} {}", name, value); }

}  // namespace

const std::vector<SolverMode>& solver_modes() {
  static const std::vector<SolverMode> offered = [] {
    std::vector<SolverMode> some;
    std::copy_if(rows.begin(), rows.end(), std::back_inserter(some),
                 [](const SolverMode& mode) { return mode.offered; });
    return some;
  }();
  return offered;
}

const SolverMode* find_solver_mode(const std::string& name) {
  const auto row =
      std::find_if(rows.begin(), rows.end(), [&](const SolverMode& mode) { return name == mode.name; });
  return row == rows.end() ? nullptr : &*row;
}

Plan plan_for(const Settings& s) {
  const SolverMode& mode = *find_solver_mode(s.mode);
  Plan plan{s.substeps == automatic ? mode.substeps : s.substeps,
            s.iterations == automatic || mode.leapfrog ? mode.iterations : s.iterations};
  plan.h = s.dt / plan.substeps;
  return plan;
}

bool leaps(const Settings& settings) { return find_solver_mode(settings.mode)->leapfrog; }
bool is_implicit(const Settings& settings) { return find_solver_mode(settings.mode)->implicit; }

std::vector<Dispatch> substep_dispatches(const Solver& solver, int iterations) {
  if (solver.schedule) return solver.schedule(iterations);
  const std::size_t move = solver.iteration.size() - 1;
  const bool apart = solver.unfused || iterations == 0;
  std::vector<Dispatch> dispatches;
  if (apart) dispatches.push_back({move, PHASE_PREDICT});
  for (int iteration = 0; iteration < iterations; ++iteration) {
    unsigned phases = PHASE_SOLVE;
    if (!apart && iteration == 0) phases |= PHASE_PREDICT;
    if (!apart && iteration + 1 == iterations) phases |= PHASE_FINISH;
    for (std::size_t pass = 0; pass <= move; ++pass) dispatches.push_back({pass, phases});
  }
  if (apart) dispatches.push_back({move, PHASE_FINISH});
  return dispatches;
}

Tuning tuning_from_environment() {
  Tuning tuning;
  const char* variable = std::getenv("TETPBD_TUNE");
  for (const std::string& assignment : split(variable ? variable : "", ',')) {
    unsigned* target = nullptr;
    for (const auto& [name, member] : {std::pair("group=", &tuning.group), std::pair("patch=", &tuning.patch),
                                       std::pair("row=", &tuning.row), std::pair("lanes=", &tuning.lanes),
                                       std::pair("threads=", &tuning.threads)})
      if (assignment.starts_with(name)) target = member;
    const char* end = assignment.data() + assignment.size();
    const char* number = assignment.data() + std::min(assignment.find('=') + 1, assignment.size());
    if (!target || std::from_chars(number, end, *target).ptr != end)
      throw Error(fmt::format("'{}' is no tuning", assignment), "TETPBD_TUNE",
                  "write group=N, patch=N, row=N, lanes=N or threads=N, separated by commas");
  }
  return tuning;
}

std::vector<Substitutions> kind_words(const ConstraintSystem& system) {
  std::vector<Substitutions> words;
  for (std::size_t k = 0; k < kind_count; ++k)
    if (system.present[k])
      words.push_back({{"KIND", constraint_kinds[k].name},
                       {"ARITY", std::to_string(constraint_kinds[k].arity)},
                       {"INDEX", std::to_string(words.size())},
                       {"PAIRS", std::to_string(record_pairs(system.lists[k]))},
                       {"MATERIAL", system.lists[k].compliance.empty() ? "0" : "1"},
                       {"PROJECT", constraint_kinds[k].components == 1 ? "project" : "project_two"},
                       {"RATE", constraint_kinds[k].rate ? "1" : "0"},
                       {"VALUES", std::to_string(constraint_kinds[k].values)},
                       {"REST", constraint_kinds[k].values == 1 ? "one" : "some"},
                       {"COMPONENTS", std::to_string(constraint_kinds[k].components)},
                       {"CURVED", constraint_kinds[k].curved ? "1" : "0"},
                       {"TETS", constraint_kinds[k].tet ? "1" : "0"},
                       {"KIND_ROW", std::to_string(k / 4)},
                       {"KIND_COLUMN", std::to_string(k % 4)}});
  return words;
}

std::vector<std::string> vertex_defines(const SolverInput& input) {
  return {define("COMPLIANT", input.compliant),
          define("RIGID_CONTACT", input.rigid),
          define("LEAPFROG", input.leapfrog),
          define("BODY_COUNT", input.model.bodies.size()),
          define("SHAPES", input.model.shapes.size()),
          define("FIELDS", has_fields(input.model)),
          define("CONTACTS", contacts_lag(input.model, input.settings))};
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
  if (tuning.storage > 0 && bytes > tuning.storage)
    throw Error("a storage buffer is too large",
                fmt::format("'{}' of {} bytes, the driver allows {}", label, bytes, tuning.storage),
                "use a smaller mesh", 1);
}

void add_buffer(Solver& solver, const Tuning& tuning, int binding, Buffer buffer) {
  check_storage(tuning, buffer.label(), buffer.bytes());
  solver.bindings.push_back({binding, buffer.id()});
  solver.buffers.push_back(std::move(buffer));
}

Cut tuned(Cut cut, const Tuning& tuning) {
  if (tuning.patch) cut.patch = tuning.patch;
  if (tuning.group) cut.group = tuning.group;
  if (!std::has_single_bit(cut.group) || cut.group > 1024)
    throw Error("no such work-group", fmt::format("{} invocations", cut.group), "a power of two up to 1024");
  return cut;
}

void add_patches(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                 unsigned group) {
  const std::size_t chunk_bytes = patches.chunks.size() * 4, vertex_bytes = patches.vertices.size() * 8,
                    record_bytes = patches.records.size() * 8;
  check_storage(input.tuning, "patches", chunk_bytes + vertex_bytes + record_bytes);
  Buffer words("patches", chunk_bytes + vertex_bytes + record_bytes);
  words.write(0, chunk_bytes, patches.chunks.data());
  words.write(chunk_bytes, vertex_bytes, patches.vertices.data());
  words.write(chunk_bytes + vertex_bytes, record_bytes, patches.records.data());
  std::size_t bytes = words.bytes() + 16 * patches.vertices.size();  // and quantized positions
  add_buffer(solver, input.tuning, BIND_PATCHES, std::move(words));
  if (input.compliant && !input.leapfrog) {
    add_buffer(solver, input.tuning, BIND_MULTIPLIERS,
               Buffer("multipliers", std::vector<float>(patches.records.size())));
    bytes += 2 * 4 * patches.records.size();  // read and written
  }
  const std::size_t owned = std::max<std::size_t>(patches.most_owned, 1),
                    vertices = std::max<std::size_t>(patches.largest, 1);
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(),
                 {define("GROUP_SIZE", group), define("PATCH_COUNT", patches.count),
                  define("CHUNK_PAIRS", patches.chunk_words / 2), define("VERTICES_AT", chunk_bytes / 8),
                  define("RECORDS_AT", (chunk_bytes + vertex_bytes) / 8), define("MAX_VERTICES", vertices),
                  define("MAX_OWNED", owned), define("CHUNKED", patches.chunked),
                  define("COUNT_GUARDS", input.tuning.count_guards)});
  solver.iteration.push_back(
      {Program::compute(shader, {{}, kind_words(input.system)}, defines), patches.count, bytes});
}

void add_average(Solver& solver, const SolverInput& input, unsigned group, bool float_sums) {
  const std::size_t vertices = input.model.positions.size();
  // Itself, its sum there and back, what neighbours see of it.
  const std::size_t bytes = vertices * (2 * sizeof(Position) + 3 * 16);
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), {define("GROUP_SIZE", group), define("FLOAT_SUMS", float_sums)});
  solver.iteration.push_back(
      {Program::compute("average.comp", {}, defines), work_groups(vertices, group), bytes});
  Buffer sums("correction sums", vertices * 16);
  sums.clear();
  add_buffer(solver, input.tuning, BIND_SUMS, std::move(sums));
}

}  // namespace tetpbd
