// A step (method.md, "A step"): dt / substeps at a time, predict, solve x iterations, finish.
#include <algorithm>

#include "sim/sim.h"

namespace tetpbd {

namespace {

// Dispatches one after the other. Whatever does not change from one to the next is not set again: at a few
// microseconds per dispatch, every call counts.
struct Dispatcher {
  Sim& sim;
  GLuint program = 0;
  void bind_quantized() const {  // read these, write the others
    if (!sim.quantized[0]) return;
    sim.quantized[sim.read_index].bind_storage(BIND_QUANTIZED);
    sim.quantized[sim.solver.double_buffered ? 1 - sim.read_index : sim.read_index].bind_storage(
        BIND_QUANTIZED_OUT);
  }
  void run(Pass& pass, unsigned phases) {
    if (sim.rigid_side) phases |= PHASE_SIDE;
    if (pass.program.id() != program) pass.program.use(), program = pass.program.id();
    constexpr std::array names = {"phases", "step_number"};
    const std::array<unsigned, 2> parameters = {phases, unsigned(sim.steps + 1)};
    if (pass.parameters[0] == ~0u)
      for (std::size_t p = 0; p < names.size(); ++p)
        pass.locations[p] = glGetUniformLocation(program, names[p]);
    for (std::size_t p = 0; p < names.size(); ++p)
      if (pass.locations[p] >= 0 && parameters[p] != pass.parameters[p])
        glUniform1ui(pass.locations[p], parameters[p]);
    pass.parameters = parameters;
    if (pass.records) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RECORDS, pass.records);
    if (sim.kernels_timed) pass.timer.begin();
    dispatch(pass.work_groups, sim.tuning.row);
    // The next dispatch reads what this one wrote, and overwrites what it read (the other quantized
    // positions, the sums of corrections that average.comp clears).
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    if (sim.kernels_timed) pass.timer.end();
  }
  // The pass that moves the vertices: what it wrote is read from then on.
  void move(unsigned phases) {
    run(sim.solver.iteration.back(), phases);
    if (sim.solver.double_buffered) sim.read_index = 1 - sim.read_index, bind_quantized();
  }
};

void bind(Sim& sim) {
  sim.step_block.bind_uniform(BIND_STEP);
  sim.positions.bind_storage(BIND_POSITIONS);
  sim.velocities.bind_storage(BIND_VELOCITIES);
  if (sim.predicted) sim.predicted.bind_storage(BIND_PREDICTED);
  sim.check.words.bind_storage(BIND_CHECK);
  if (sim.rigid_bodies) sim.rigid_bodies.bind_storage(BIND_RIGID);
  if (sim.pairs) sim.pairs.sums.bind_storage(BIND_PAIR_SUMS);
  for (const auto& [binding, buffer] : sim.solver.bindings)
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, GLuint(binding), buffer);
  if (!sim.guard_counts) return;
  // Counters have 32 bits: read before they can wrap.
  const double per_step = 4.0 * double(sim.system.count()) * sim.plan.iterations * sim.plan.substeps;
  if (sim.steps % std::max(1L, long(2e9 / std::max(per_step, 1.0))) == 0) guard_counts(sim);
  glBindBufferBase(GL_ATOMIC_COUNTER_BUFFER, BIND_GUARDS, sim.guard_counts.id());
}

void step_on_gpu(Sim& sim, bool moving) {
  count_down_renewal(sim);
  const unsigned watched = watch(sim);
  if (moving) write_shapes(sim);
  look_around(sim);
  bind(sim);
  bind_shapes(sim, 0);
  if (sim.timed) sim.timer.begin();
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // a picture may still be drawn from what this overwrites
  Dispatcher dispatcher{sim};
  if (sim.needs_predict) {
    forget_contacts(sim);
    if (sim.quantized[0]) sim.quantized[sim.read_index].bind_storage(BIND_QUANTIZED_OUT);
    dispatcher.run(sim.predict, 0);
  }
  dispatcher.bind_quantized();
  sim.needs_predict = false;
  const int substeps = sim.plan.substeps;
  for (int substep = 0; substep < substeps; ++substep) {
    if (moving) bind_shapes(sim, ++sim.shapes_now);
    if (sim.rigid_bodies) dispatcher.run(sim.rigid_contact, 0), sim.rigid_side = 1 - sim.rigid_side;
    for (const Dispatch& dispatch : sim.substep)
      if (dispatch.pass + 1 == sim.solver.iteration.size())
        dispatcher.move(dispatch.phases | (substep == 0 ? watched : 0) |
                        (dispatch.phases & PHASE_PREDICT ? sim.pairs.phases : 0));
      else
        dispatcher.run(sim.solver.iteration[dispatch.pass], dispatch.phases);
    if (sim.pairs && sim.pairs.near) {
      touch(sim, substeps - 1 - substep);
      dispatcher.program = 0, dispatcher.bind_quantized();
    }
  }
  // Vertex fetches and copies read the state next.
  glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  if (sim.timed) sim.timer.end();
}

}  // namespace

void step(Sim& sim) {
  const bool moving = std::ranges::any_of(sim.model->shapes, moves);
  if (on_cpu(sim)) {
    const GuardCounts counts =
        sim.solver.step_on_cpu(sim.host, sim.settings, sim.inverse_masses, time_of(sim));
    for (std::size_t g = 0; g < GUARDS; ++g) sim.guards[g] += counts[g];
    upload(sim, sim.host);
  } else {
    step_on_gpu(sim, moving);
  }
  ++sim.steps;
  if (on_cpu(sim) && moving) write_shapes(sim);
  check_step(sim);
}

}  // namespace tetpbd
