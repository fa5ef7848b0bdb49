#include "sim/snapshot.h"

#include <algorithm>

#include "sim/gl/keep_bindings.h"

namespace tetpbd {
namespace {

State state_in(const Buffer& from, std::size_t at, std::size_t vertices, std::size_t yielding_tets) {
  std::vector<Position> positions(vertices);
  std::vector<Velocity> velocities(vertices);
  from.read(at, vertices * sizeof(Position), positions.data());
  from.read(at + vertices * sizeof(Position), vertices * sizeof(Velocity), velocities.data());
  State state = make_state(positions, velocities);
  const std::size_t behind = at + vertices * (sizeof(Position) + sizeof(Velocity));
  if (yielding_tets > 0) state.rest_metrics = rest_metrics_in(from, behind, yielding_tets);
  return state;
}

// Restores everything, so that the next steps give the same bits as those that followed then.
void restore_all(Sim& sim, const Snapshot& then, const Buffer& from) {
  const std::byte* byte = then.values.data();
  for (const std::span<std::byte> values : carried(sim).values)
    std::copy_n(byte, values.size(), values.data()), byte += values.size();
  static_cast<StepValues&>(sim) = then.step;
  sim.plan = then.plan;
  sim.led.vertices.clear(), sim.led.places.clear();
  sim.solver.refresh(sim);
  write_step_block(sim);
  if (then.host) sim.host = *then.host, upload(sim, *then.host);
  Carried now = carried(sim);  // after `step`, which says which sides of double buffers were read
  std::size_t at = then.at;
  for (const CarriedRange& range : now.ranges) {
    from.copy_to(*range.buffer, range.first, at, range.bytes);
    at += range.bytes;
  }
  for (std::size_t r = 0; r < now.readbacks.size(); ++r)
    *now.readbacks[r].first = then.readbacks[r] ? Fence::here() : Fence();
  sim.needs_predict = then.step.needs_predict;
  sim.yielding.copied = false;
  start_check(sim, nullptr);
  sim.check.found = then.found;
}

}  // namespace

std::size_t snapshot_bytes(Sim& sim) {
  std::size_t bytes = 0;
  for (const CarriedRange& range : carried(sim).ranges) bytes += range.bytes;
  return bytes;
}

std::size_t snapshot_memory(const Sim& sim) {
  const std::size_t host_bytes = sim.model->positions.size() * 2 * sizeof(glm::dvec3);
  return sizeof(Snapshot) + (on_cpu(sim) ? host_bytes : 0);
}

Snapshot take_snapshot(Sim& sim, const Buffer& to, std::size_t at, bool good_only) {
  const KeepBindings kept;
  Snapshot taken{sim.settings, sim.plan, sim};
  taken.found = sim.check.found, taken.at = at, taken.broken = sim.broken;
  if (on_cpu(sim)) taken.host = sim.host;
  const Carried all = carried(sim);
  for (const std::span<std::byte> values : all.values)
    taken.values.insert(taken.values.end(), values.begin(), values.end());
  for (const auto& [fence, under_way] : all.readbacks) taken.readbacks.push_back(under_way);
  if (!all.ranges.empty()) copy_ranges(sim.check, all.ranges, to, at, good_only);
  return taken;
}

void restore_snapshot(Sim& sim, const Snapshot& then, const Buffer& from) {
  const KeepBindings kept;
  if (then.settings == sim.settings && then.broken == sim.broken) return restore_all(sim, then, from);
  set_broken(sim, then.broken);
  const Model& model = *sim.model;
  const std::size_t tets = any_material(then.settings, yields) ? model.rest.tets.size() : 0;
  State state = then.host ? *then.host : state_in(from, then.at, model.positions.size(), tets);
  go_on_from(sim, std::move(state), then.step, then.settings.dt, half_substep_fall(then.settings, then.plan));
}

void go_on_from(Sim& sim, State state, const StepValues& then, double dt, double fall) {
  forget_all(sim);
  sim.steps = then.steps;
  sim.origin = {sim.steps, then.origin.time + double(sim.steps - then.origin.step) * dt};
  start_with(sim, std::move(state), fall);
}

}  // namespace tetpbd
