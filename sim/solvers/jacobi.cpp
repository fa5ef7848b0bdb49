#include "sim/solvers/jacobi.h"

#include <algorithm>
#include <memory>

#include "sim/sim.h"
#include "sim/solvers/rings.h"

namespace tetpbd {

namespace {

void move_vertices(Sim& sim, Pass& pass, unsigned phases) {
  // How often velocities and predicted positions are read or written.
  static constexpr struct {
    const char* name;
    std::size_t accesses;
  } variants[] = {{"", 0}, {", predict", 3}, {", finish", 3}, {", predict, finish", 2}};
  const bool predicts = phases & PHASE_PREDICT, finishes = phases & PHASE_FINISH;
  const auto& [name, accesses] = variants[predicts + 2 * finishes];
  run_kernel(sim, pass, phases | (finishes ? sim.pairs.phases : 0), name,
             accesses * sim.model->positions.size() * sizeof(Velocity));
  turn_quantized(sim);
}

// The first iteration predicts and the last one makes velocities, unless the mode has dispatches of their own for that.
void run_substep(Sim& sim, JacobiPasses& jacobi) {
  const int iterations = sim.plan.iterations;
  const bool apart = jacobi.unfused || iterations == 0;
  Pass& last = jacobi.passes.back();
  if (apart) move_vertices(sim, last, PHASE_PREDICT);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    unsigned phases = PHASE_SOLVE;
    if (!apart && iteration == 0) phases |= PHASE_PREDICT;
    if (!apart && iteration + 1 == iterations) phases |= PHASE_FINISH;
    for (std::size_t pass = 0; pass + 1 < jacobi.passes.size(); ++pass) run_kernel(sim, jacobi.passes[pass], phases);
    move_vertices(sim, last, phases);
  }
  if (apart) move_vertices(sim, last, PHASE_FINISH);
}

}  // namespace

void add_jacobi(Solver& solver, const SolverInput& input, JacobiPasses passes) {
  solver.keeps_prediction = true;
  add_prediction(solver, input);
  solver.substep = [jacobi = std::make_shared<JacobiPasses>(std::move(passes))](Sim& sim, int) {
    run_substep(sim, *jacobi);
  };
}

void add_prediction(Solver& solver, const SolverInput& input) {
  constexpr unsigned group = 256;
  const std::size_t count = input.model.positions.size();
  const auto pass =
      std::make_shared<Pass>(Program::compute("solvers/predict.comp", scheme_words(input), vertex_defines(input)),
                             work_groups(count, group), count * (sizeof(Position) + sizeof(Velocity) + 16));
  solver.predict = [pass](Sim& sim) {
    sim.recorder.give("QuantizedOut", sim.quantized[sim.read_index]);
    run_kernel(sim, *pass);
    give_quantized(sim);
  };
}

Pass make_patch_pass(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                     unsigned group, bool multipliers) {
  const std::size_t chunk_bytes = patches.chunks.size() * 4, vertex_bytes = patches.vertices.size() * 8,
                    record_bytes = patches.records.size() * 8;
  check_storage(input.tuning, "patches", chunk_bytes + vertex_bytes + record_bytes);
  Buffer words("patches", chunk_bytes + vertex_bytes + record_bytes);
  words.write(0, chunk_bytes, patches.chunks.data());
  words.write(chunk_bytes, vertex_bytes, patches.vertices.data());
  words.write(chunk_bytes + vertex_bytes, record_bytes, patches.records.data());
  if (any_material(input.settings, yields)) {
    solver.rest_block = "Patches", solver.rest_copies = patches.tets;
    const std::size_t first = 2 * (patches.chunks.size() / 2 + patches.vertices.size()) + 1;  // behind vertex numbers
    for (auto& copy : solver.rest_copies) copy[1] = std::uint32_t(first + 2 * copy[1]);
  }
  std::size_t bytes = words.bytes() + 16 * patches.vertices.size();  // and quantized positions
  add_buffer(solver, input.tuning, "Patches", std::move(words));
  if (input.compliant && multipliers) {
    add_buffer(solver, input.tuning, "Multipliers", Buffer("multipliers", std::vector<float>(patches.records.size())));
    bytes += 2 * 4 * patches.records.size();  // read and written
  }
  const std::size_t owned = std::max<std::size_t>(patches.most_owned, 1),
                    vertices = std::max<std::size_t>(patches.largest, 1);
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), {define("GROUP_SIZE", group), define("PATCH_COUNT", patches.count),
                                 define("CHUNK_PAIRS", patches.chunk_words / 2), define("VERTICES_AT", chunk_bytes / 8),
                                 define("RECORDS_AT", (chunk_bytes + vertex_bytes) / 8),
                                 define("MAX_VERTICES", vertices), define("MAX_OWNED", owned),
                                 define("CHUNKED", patches.chunked), define("AVERAGED", has_averages(input.system)),
                                 define("RING_LANES", 16), define("COUNT_GUARDS", input.tuning.count_guards)});
  return {Program::compute(shader, {{}, kind_words(input.system)}, defines), patches.count, bytes};
}

Pass make_average_pass(Solver& solver, const SolverInput& input, unsigned group, bool float_sums) {
  const std::size_t vertices = input.model.positions.size();
  // Itself, its sum there and back, what neighbours see of it.
  const std::size_t bytes = vertices * (2 * sizeof(Position) + 3 * 16);
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), {define("GROUP_SIZE", group), define("FLOAT_SUMS", float_sums)});
  Buffer sums("correction sums", vertices * 16);
  sums.clear();
  add_buffer(solver, input.tuning, "Sums", std::move(sums));
  return {Program::compute("solvers/average.comp", {}, defines), work_groups(vertices, group), bytes};
}

}  // namespace tetpbd
