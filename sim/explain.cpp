// What a simulation allocates and dispatches.
#include <algorithm>
#include <cmath>
#include <map>

#include "sim/sim.h"

namespace tetpbd {

Explanation explain(Sim& sim, int timed_steps) {
  Pairs& p = sim.pairs;
  Explanation result;
  const auto add = [&](const Buffer& buffer) {
    if (!buffer) return;
    result.buffers.push_back({buffer.label(), buffer.bytes()});
    result.bytes += buffer.bytes();
  };
  for (const Buffer* buffer : {&sim.positions,
                               &sim.velocities,
                               &sim.predicted,
                               &sim.quantized[0],
                               &sim.quantized[1],
                               &sim.step_block,
                               &sim.guard_counts,
                               &sim.check.words,
                               &sim.check.read_back,
                               &sim.check.checkpoint,
                               &sim.rigid_bodies,
                               &sim.shapes,
                               &sim.fields,
                               &p.mesh,
                               &p.rest,
                               &p.spheres,
                               &p.lists,
                               &p.sums,
                               &p.empty,
                               &p.answer})
    add(*buffer);
  for (const Buffer& buffer : sim.solver.buffers) add(buffer);
  if (on_cpu(sim)) return result;

  std::map<Pass*, std::optional<double>> times_of;
  const auto mean = [](Timer& timer) {
    double sum = 0;
    int count = 0;
    for (; const auto ms = timer.poll(true); ++count) sum += *ms;
    return std::pair(count > 0 ? std::optional(sum / count) : std::nullopt, count);
  };
  const auto time_of = [&](Pass& pass) {
    if (const auto known = times_of.find(&pass); known != times_of.end()) return known->second;
    return times_of[&pass] = mean(pass.timer).first;
  };
  const auto kernel = [&](Pass& pass, const std::string& what, long per_step, std::size_t more) {
    const auto ms = time_of(pass);
    result.dispatches.push_back(
        {pass.program.label() + what, pass.work_groups, per_step, pass.bytes + more, ms});
    result.ms_per_step += ms.value_or(0) * double(per_step);
    result.dispatches_per_step += per_step;
    result.bytes_per_step += (pass.bytes + more) * std::size_t(per_step);
  };
  kernel(sim.predict, "", 0, 0);
  if (sim.rigid_bodies) kernel(sim.rigid_contact, "", sim.plan.substeps, 0);
  std::map<std::pair<std::size_t, unsigned>, long> times;  // of a pass with these phases, per substep
  for (const Dispatch& dispatch : sim.substep)
    ++times[{dispatch.pass, sim.solver.schedule ? 0 : dispatch.phases}];
  for (const auto& [dispatch, count] : times) {
    const auto& [pass, phases] = dispatch;
    std::string what;
    std::size_t more = 0;  // velocities and predicted positions, there or back
    if (pass + 1 == sim.solver.iteration.size() && !sim.solver.schedule) {
      const bool predicts = phases & PHASE_PREDICT, finishes = phases & PHASE_FINISH;
      for (const auto& [does, name] : {std::pair(predicts, ", predict"), std::pair(finishes, ", finish")})
        if (does) what += name;
      if (predicts || finishes)
        more = sim.model->positions.size() * sizeof(Velocity) * (predicts && finishes ? 2 : 3);
    }
    kernel(sim.solver.iteration[pass], what, count * sim.plan.substeps, more);
  }
  for (Pairs::Kernel* k : {&p.boxes, &p.cull, &p.query, &p.query_edges, &p.meet, &p.push, &p.meet_and_push})
    if (const auto [ms, count] = mean(k->timer); ms) {
      const long per_step = std::lround(double(count) / std::max(timed_steps, 1));
      const std::string what = k == &p.query_edges ? " of edges" : k == &p.meet_and_push ? ", and push" : "";
      result.dispatches.push_back({k->program.label() + what, k->work_groups, per_step, 0, ms});
      result.ms_per_step += *ms * count / std::max(timed_steps, 1), result.dispatches_per_step += per_step;
    }
  return result;
}

}  // namespace tetpbd
