// What a simulation allocates and dispatches.
#include <algorithm>
#include <cmath>

#include "sim/gl/keep_bindings.h"
#include "sim/snapshot.h"

namespace tetpbd {

Explanation explain(Sim& sim, int timed_steps) {
  const KeepBindings kept;
  const Pairs& p = sim.pairs;
  Explanation result;
  const auto add = [&](const Buffer& buffer) {
    if (!buffer) return;
    result.buffers.push_back({buffer.label(), buffer.bytes()});
    result.bytes += buffer.bytes();
  };
  const auto add_all = [&](const auto&... buffers) { (add(buffers), ...); };
  add_all(sim.positions, sim.velocities, sim.quantized[0], sim.quantized[1], sim.step_block, sim.guard_counts,
          sim.check.words, sim.check.read_back, sim.check.checkpoint, sim.rigid_bodies, sim.obstacles.records,
          sim.obstacles.fields, p.mesh, p.lists, p.balls, p.leaf_pairs, p.candidates, p.pairs, p.sums, p.listed,
          p.empty, p.readback, sim.faces.corners, sim.faces.sums, sim.led.records, sim.loads.records, sim.loads.mesh,
          sim.loads.accelerations, sim.activation.records, sim.activation.before, sim.yielding.records,
          sim.yielding.copies);
  for (const Buffer& buffer : sim.solver.buffers) add(buffer);
  if (on_cpu(sim)) return result;

  if (timed_steps == 0) {
    // The second of two steps is counted, because only the first after a change from outside predicts.
    const Buffer stored("explained", snapshot_bytes(sim));
    const Snapshot before = take_snapshot(sim, stored, 0);
    step(sim);
    sim.recorder.counting = true;
    step(sim);
    sim.recorder.counting = false;
    restore_snapshot(sim, before, stored);
  }
  const double steps = std::max(timed_steps, 1);
  for (DispatchCount& counted : sim.recorder.counted) {
    double sum = 0;
    int times = 0;
    for (; const auto ms = counted.timer.poll(true); ++times) sum += *ms;
    const std::optional<double> ms = times > 0 ? std::optional(sum / times) : std::nullopt;
    const double per_step = double(counted.dispatches) / steps;
    result.dispatches.push_back({counted.name, counted.work_groups, std::lround(per_step), counted.bytes, ms});
    result.ms_per_step += ms.value_or(0) * per_step;
    result.dispatches_per_step += std::lround(per_step);
    result.bytes_per_step += std::size_t(double(counted.bytes) * per_step);
  }
  sim.recorder.counted.clear();
  return result;
}

}  // namespace tetpbd
