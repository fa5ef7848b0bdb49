#include "sim/solvers/solver.h"

#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cstdlib>

#include "sim/error.h"
#include "sim/layout.h"
#include "sim/parallel.h"

namespace tetpbd {

const std::vector<SolverMode>& solver_modes() {
  static const std::vector<SolverMode> rows = {
      {"node", "Jacobi on the GPU, a thread a vertex gathers all its constraints in one dispatch",
       create_node_solver},
      {"constraint", "Jacobi on the GPU, a thread a constraint adds to its vertices with integer atomics",
       create_constraint_solver},
      {"cpu", "non-linear Gauss-Seidel on one CPU core, the paper's baseline", create_cpu_solver},
      {"cpu-double", "the same in double precision: what stability is held against",
       create_cpu_double_solver},
      {"cpu-fast", "Gauss-Seidel by colours on all CPU cores, with vector instructions",
       create_cpu_fast_solver},
      {"groups", "Gauss-Seidel on the GPU between K groups of constraints, averaged inside each",
       create_groups_solver},
  };
  return rows;
}

const SolverMode* find_solver_mode(const std::string& name) {
  static const SolverMode paper = {
      "paper", "the paper's GPU pipeline: a kernel a kind, floats added by compare-and-swap",
      create_paper_solver};
  for (const SolverMode& mode : solver_modes())
    if (name == mode.name) return &mode;
  return name == paper.name ? &paper : nullptr;
}

Tuning tuning_from_environment() {
  Tuning tuning;
  const char* variable = std::getenv("TETPBD_TUNE");
  for (const std::string& assignment : split(variable ? variable : "", ',')) {
    unsigned* target = nullptr;
    for (const auto& [name, member] :
         {std::pair("group=", &tuning.group), std::pair("patch=", &tuning.patch),
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

std::vector<Substitutions> kind_words(const ConstraintSystem& system) {
  std::vector<Substitutions> rows;
  for (std::size_t k = 0; k < system.lists.size(); ++k) {
    if (!system.present[k]) continue;
    const std::size_t index = rows.size();
    rows.push_back({{"KIND", constraint_kinds()[k].name},
                    {"ARITY", std::to_string(constraint_kinds()[k].arity)},
                    {"INDEX", std::to_string(index)},
                    {"BINDING", std::to_string(BIND_RECORDS + index)},
                    {"KIND_ROW", std::to_string(k / 4)},
                    {"KIND_COLUMN", std::to_string(k % 4)}});
  }
  return rows;
}

Buffer record_buffer(const ConstraintList& list, const std::string& kind) {
  const std::size_t arity = std::size_t(list.arity), row = arity + 1;
  std::vector<std::uint32_t> words(list.count() * row);
  parallel_for(list.count(), [&](std::size_t first, std::size_t end) {
    for (std::size_t c = first; c < end; ++c) {
      std::copy_n(list.vertices.data() + c * arity, arity, words.data() + c * row);
      words[c * row + arity] = std::bit_cast<std::uint32_t>(float(list.rest[c]));
    }
  });
  return Buffer("records " + kind, words);
}

std::vector<Buffer> record_buffers(const ConstraintSystem& system) {
  std::vector<Buffer> buffers;
  for (std::size_t k = 0; k < system.lists.size(); ++k)
    if (system.present[k]) buffers.push_back(record_buffer(system.lists[k], constraint_kinds()[k].name));
  return buffers;
}

void check_storage(const Tuning& tuning, const std::string& label, std::size_t bytes) {
  if (tuning.storage > 0 && bytes > tuning.storage)
    throw Error("a storage buffer is too large",
                fmt::format("'{}' of {} bytes, the driver allows {}", label, bytes, tuning.storage),
                "use a smaller mesh", 1);
}

Cut tuned(Cut cut, const Tuning& tuning) {
  if (tuning.patch) cut.patch = tuning.patch;
  if (tuning.group) cut.group = tuning.group;
  if (!std::has_single_bit(cut.group) || cut.group > 1024)
    throw Error("no such work-group", fmt::format("{} invocations", cut.group), "a power of two up to 1024");
  return cut;
}

std::vector<std::string> compliance_defines(bool compliant, bool damped) {
  std::vector<std::string> defines;
  if (compliant) defines.push_back("COMPLIANT");
  if (damped) defines.push_back("DAMPED");
  return defines;
}

namespace {

constexpr std::size_t few_handles = 8;  // up to here each patch has all, in their order

// The lists of each patch's handles, and the buffers of handles.glsl; returns the length of the longest list.
std::size_t add_handles(Solver& solver, const SolverInput& input, const Patches& patches, Handles& handles) {
  if (patches.count > 65536)  // as many numbers of 16 bits fit 32
    throw Error("the body is too large for handles", fmt::format("{} patches", patches.count),
                "set handles to 0, or take a mesh of at most 20 million tets");
  for (layout::Handle& handle : handles.handles) handle.keeper = ~0u;
  std::vector<std::vector<std::uint32_t>> lists(patches.count);
  std::size_t most = 1;
  for (std::size_t p = 0; p < patches.count; ++p) {
    const std::uint32_t* words = patches.parts.data() + p * patches.part_words;
    for (std::uint32_t h = 0; h < handles.handles.size(); ++h) {
      const auto held = [&](std::uint32_t v) {
        return glsl::Rigid{}.handle_weight(handles.rest[v], handles.handles[h].node) > 0;
      };
      bool any = handles.handles.size() <= few_handles;
      for (std::uint32_t v = words[2]; v < words[2] + words[1] && !any; ++v) any = held(v);
      if (!any) continue;
      lists[p].push_back(h);
      if (handles.handles[h].keeper == ~0u) handles.handles[h].keeper = std::uint32_t(p);
    }
    most = std::max(most, lists[p].size());
  }
  layout::Handle none{};
  none.number = ~0u;
  std::vector<layout::Handle> copies(patches.count * most, none);  // beside each other, for each patch
  for (std::size_t p = 0; p < patches.count; ++p)
    for (std::size_t k = 0; k < lists[p].size(); ++k) {
      layout::Handle& copy = copies[p * most + k] = handles.handles[lists[p][k]];
      copy.number = lists[p][k];
    }
  const auto add = [&](const char* label, int binding, const auto& data) {
    solver.buffers.push_back(storage_buffer(input.tuning, label, data));
    solver.bindings.push_back({binding, solver.buffers.back().id()});
  };
  add("handles", BIND_HANDLES, copies);
  add("handle rest", BIND_HANDLE_REST, handles.rest);
  add("handle sums", BIND_HANDLE_SUMS, std::vector<std::uint32_t>(3 * HANDLE_ROW * handles.handles.size()));
  return most;
}

}  // namespace

void add_patches(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                 unsigned group, bool grouped, Handles* handles) {
  std::size_t bytes = 0, most_handles = 0;
  const auto add = [&](const char* label, int binding, const auto& data) {
    solver.buffers.push_back(storage_buffer(input.tuning, label, data));
    solver.bindings.push_back({binding, solver.buffers.back().id()});
    bytes += solver.buffers.back().bytes();
  };
  add("patches", BIND_PARTS, patches.parts);
  add("patch vertices", BIND_PATCH_VERTICES, patches.vertices);
  add("patch records", BIND_PATCH_RECORDS, patches.records);
  if (handles) {
    most_handles = add_handles(solver, input, patches, *handles);
    bytes += 32 * patches.count * patches.most_summed + 2 * solver.buffers.back().bytes();
  }
  const std::size_t summed = std::max<std::size_t>(patches.most_summed, 1);
  const std::size_t chunk =
      std::clamp<std::size_t>(group / summed, 1, std::clamp<std::size_t>(most_handles, 1, 8));
  const ShaderWords words = {
      {{"GROUP", std::to_string(group)},
       {"HANDLES", std::to_string(most_handles)},
       {"ALL_HANDLES", handles && handles->handles.size() <= few_handles ? "1" : "0"},
       {"HANDLE_COUNT", std::to_string(handles ? handles->handles.size() : 0)},
       {"PATCHES", std::to_string(patches.count)},
       {"PART_WORDS", std::to_string(patches.part_words)},
       {"CHUNK", std::to_string(chunk)},
       {"HERE",
        std::to_string(std::max({patches.largest, std::size_t(1), handles ? (1 + chunk) * summed : 0}))},
       {"VERTICES", std::to_string(std::max<std::size_t>(patches.largest, 1))},
       {"SUMMED", std::to_string(summed)},
       {"PARTED", patches.parted ? "1" : "0"},
       {"GROUPED", grouped ? "1" : "0"},
       {"COUNT_GUARDS", input.tuning.count_guards ? "1" : "0"}},
      kind_words(input.system)};
  bytes += 16 * patches.vertices.size() * (input.damped ? 2 : 1);  // places
  if (input.compliant) {
    add("multipliers", BIND_MULTIPLIERS, std::vector<float>(patches.records.size()));
    bytes += solver.buffers.back().bytes();  // read and written
  }
  const auto defines = compliance_defines(input.compliant, input.damped);
  solver.iteration.push_back({Program::compute(shader, words, defines), patches.count,
                              bytes / std::size_t(grouped ? input.groups : 1)});
}

void add_average(Solver& solver, const SolverInput& input, unsigned group, bool float_sums) {
  const std::size_t vertices = input.model.positions.size();
  const ShaderWords words = {{{"GROUP", std::to_string(group)}, {"FLOAT_SUMS", float_sums ? "1" : "0"}}, {}};
  const std::size_t bytes =
      vertices * (2 * sizeof(Position) + 3 * 16);  // itself, its sum there and back, its place
  const auto defines = compliance_defines(input.compliant, input.damped);
  solver.iteration.push_back(
      {Program::compute("average.comp", words, defines), work_groups(vertices, group), bytes});
  Buffer deltas("deltas", vertices * 16);
  deltas.clear();
  solver.bindings.push_back({BIND_DELTAS, deltas.id()});
  solver.buffers.push_back(std::move(deltas));
}

}  // namespace tetpbd
