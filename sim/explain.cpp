// What a simulation allocates and dispatches.
#include <map>

#include "sim/sim.h"

namespace tetpbd {

Explanation explain(const Sim& sim) {
  Explanation result;
  const auto add = [&](const Buffer& buffer) {
    if (!buffer) return;
    result.buffers.push_back({buffer.label(), buffer.bytes()});
    result.bytes += buffer.bytes();
  };
  for (const Buffer* buffer :
       {&sim.positions, &sim.velocities, &sim.predicted, &sim.quantized[0], &sim.quantized[1],
        &sim.step_block, &sim.guard_counts, &sim.check.words, &sim.check.read_back, &sim.check.positions,
        &sim.check.velocities, &sim.rigid_bodies})
    add(*buffer);
  for (const Buffer& buffer : sim.solver.buffers) add(buffer);
  if (on_cpu(sim)) return result;

  const auto kernel = [&](const Pass& pass, const std::string& what, long per_step, std::size_t more) {
    result.dispatches.push_back({pass.program.label() + what, pass.work_groups, per_step, pass.bytes + more});
    result.dispatches_per_step += per_step;
    result.bytes_per_step += (pass.bytes + more) * std::size_t(per_step);
  };
  kernel(sim.predict, "", 0, 0);
  if (sim.rigid_bodies) kernel(sim.rigid_contact, "", sim.settings.substeps, 0);
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
    kernel(sim.solver.iteration[pass], what, count * sim.settings.substeps, more);
  }
  return result;
}

}  // namespace tetpbd
