#include "sim/snapshot.h"

#include <utility>

namespace tetpbd {

namespace {

struct Part {
  const Buffer* buffer;
  std::size_t first, bytes;
};

// Of a GPU mode: the state, then what goes with the settings.
std::vector<Part> parts_of(const Sim& sim) {
  std::vector<Part> parts;
  const auto add = [&](const Buffer& buffer) { parts.push_back({&buffer, 0, buffer.bytes()}); };
  if (on_cpu(sim)) return parts;
  add(sim.positions), add(sim.velocities);
  if (sim.quantized[0]) add(sim.quantized[sim.read_index]);
  if (sim.rigid_bodies) add(sim.rigid_bodies);
  for (const auto& [buffer, first, bytes] : sim.solver.handed_on)
    parts.push_back({&sim.solver.buffers[buffer], first, bytes});
  if (sim.watch.answer) add(sim.watch.answer), parts.push_back({&sim.check.words, 8, 8});
  if (sim.pairs) {
    const std::size_t words = 4 * sim.model->positions.size();
    parts.push_back({&sim.pairs.lists, 0, sim.pairs.handed_on}), add(sim.pairs.answer);
    if (sim.pairs.lag)
      parts.push_back({&sim.pairs.sums, Pairs::sum_words * words, Pairs::sharing_words * words});
  }
  return parts;
}

State state_in(const Buffer& from, std::size_t at, std::size_t vertices) {
  std::vector<Position> positions(vertices);
  std::vector<Velocity> velocities(vertices);
  from.read(at, vertices * sizeof(Position), positions.data());
  from.read(at + vertices * sizeof(Position), vertices * sizeof(Velocity), velocities.data());
  return state_of(positions, velocities);
}

}  // namespace

std::size_t snapshot_bytes(const Sim& sim) {
  std::size_t bytes = 0;
  for (const Part& part : parts_of(sim)) bytes += part.bytes;
  return bytes;
}

std::size_t snapshot_memory(const Sim& sim) {
  const std::size_t of_host =
      sim.model->positions.size() * 2 * sizeof(glm::dvec3) + sim.host.held.size() * sizeof(State::Held);
  return sizeof(Snapshot) + (on_cpu(sim) ? of_host : 0);
}

Snapshot take_snapshot(const Sim& sim, const Buffer& to, std::size_t at) {
  Snapshot taken{sim.steps,
                 sim.origin,
                 sim.settings,
                 sim.quantum,
                 sim.needs_predict,
                 sim.read_index,
                 sim.rigid_side,
                 sim.watch,
                 sim.pairs,
                 bool(sim.watch.asked),
                 bool(sim.pairs.asked),
                 sim.check.found,
                 {},
                 at};
  if (on_cpu(sim)) taken.host = sim.host;
  std::vector<CopiedPart> copied;
  for (const Part& part : parts_of(sim)) {
    copied.push_back({part.buffer, part.first, &to, at, part.bytes});
    at += part.bytes;
  }
  if (!copied.empty()) copy_parts(sim.check, copied, false);
  return taken;
}

void restore_snapshot(Sim& sim, const Snapshot& then, const Buffer& from) {
  finish_renewal(sim);
  sim.steps = then.steps, sim.origin = then.origin;
  sim.needs_predict = true;
  const bool same_kind = on_cpu(sim) == then.host.has_value();
  if (same_kind && sim.watch.at_rest > 0) set_stiffening(sim, then.watch.stiffening);
  if (is_implicit(sim.settings)) set_finer(sim, is_implicit(then.settings) ? then.watch.finer : 1);
  const bool exact = same_kind && then.settings == sim.settings;
  if (std::exchange(sim.quantum, then.quantum) != then.quantum) apply_settings(sim, sim.settings);
  sim.read_index = then.read_index, sim.rigid_side = then.rigid_side;
  if (on_cpu(sim) || then.host) {
    const State state = then.host ? *then.host : state_in(from, then.at, sim.model->positions.size());
    if (on_cpu(sim)) sim.host = state;
    upload(sim, state);
  } else {
    std::size_t at = then.at, copied = 0;
    for (const Part& part : parts_of(sim)) {
      if (!exact && ++copied > 2) break;
      from.copy_to(*part.buffer, part.first, at, part.bytes);
      at += part.bytes;
    }
  }
  if (exact) {
    static_cast<WatchNumbers&>(sim.watch) = then.watch;
    sim.watch.asked = then.asked ? Fence::here() : Fence();
    static_cast<PairNumbers&>(sim.pairs) = then.pairs;
    sim.pairs.asked = then.pairs_asked ? Fence::here() : Fence();
    sim.needs_predict = then.needs_predict;
  } else {
    forget_answers(sim);
    sim.watch.stiffer = 1, sim.watch.calm = 0;
    retime_velocities(sim, then.settings);
    if (sim.pairs) start_pairs(sim, read_state(sim));
  }
  write_shapes(sim);
  start_check(sim, nullptr);
  sim.check.found = then.found;
}

}  // namespace tetpbd
