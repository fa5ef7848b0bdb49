// A step (method.md, "A step"): each substep predicts, solves as often as there are iterations, and finishes.
#include <algorithm>

#include "sim/contact/moving_obstacle.h"
#include "sim/contact/rigid_contact.h"
#include "sim/gl/keep_bindings.h"
#include "sim/model/attachments.h"
#include "sim/model/material.h"
#include "sim/sim.h"
#include "sim/solvers/substep.h"

namespace tetpbd {

void give_quantized(Sim& sim) {
  const int count = sim.solver.quantized_buffers;
  if (count == 0) return;
  sim.recorder.give("Quantized", sim.quantized[sim.read_index]);
  sim.recorder.give("QuantizedOut", sim.quantized[count == 2 ? 1 - sim.read_index : sim.read_index]);
}

void turn_quantized(Sim& sim) {
  if (sim.solver.quantized_buffers < 2) return;
  sim.read_index = 1 - sim.read_index;
  give_quantized(sim);
}

void run_kernel(Sim& sim, Pass& pass, unsigned phases, const char* what, std::size_t bytes) {
  if (sim.rigid_side) phases |= PHASE_SIDE;
  sim.recorder.run(pass, {{"phases", phases}, {"step_number", unsigned(sim.steps + 1)}}, what, bytes);
}

namespace {

void give_buffers(Sim& sim) {
  Recorder& recorder = sim.recorder;
  recorder.begin();
  sim.step_block.bind_uniform(BIND_STEP);
  recorder.give("Positions", sim.positions), recorder.give("Velocities", sim.velocities);
  recorder.give("Check", sim.check.words);
  if (sim.fineness) bind_texels(UNIT_QUANTA, sim.fineness_texture);
  recorder.give("RigidBodies", sim.rigid_bodies);
  for (const auto& [block, buffer] : sim.solver.bindings) recorder.give(block, buffer);
  give_quantized(sim);
  if (!sim.guard_counts) return;
  // Counters have 32 bits and are read before they can wrap.
  const double per_step = 4.0 * double(sim.system.count()) * sim.plan.iterations * sim.plan.substeps;
  if (sim.steps % std::max(1L, long(2e9 / std::max(per_step, 1.0))) == 0) guard_counts(sim);
  glBindBufferBase(GL_ATOMIC_COUNTER_BUFFER, BIND_GUARDS, sim.guard_counts.id());
}

// m, the mean edge of each body, in one pass: edges are sorted by vertex, in the order of the bodies.
std::vector<double> mean_edges(const Model& model, const ConstraintList& edges) {
  std::vector<double> means;
  std::size_t c = 0;
  for (const Body& body : model.bodies) {
    const std::size_t first = c, count = edges.count();
    double sum = 0;
    for (; c < count && edges.ends(c)[0] < body.first_vertex + body.vertices; ++c) sum += edges.rest[c];
    means.push_back(c > first ? sum / double(c - first) : 0);
  }
  return means;
}

// Resets the records of hard bodies, because vertices were moved from outside.
void forget_contacts(Sim& sim) {
  if (!sim.rigid_bodies) return;
  forget_impulses(sim.pairs);
  const std::vector<double> edges = mean_edges(*sim.model, sim.system.lists[std::size_t(index_of<Stretch>)]);
  const std::vector<char> loose = loose_pieces(*sim.model, sim.system);
  std::vector<RigidRecord> records;
  for (const Body& body : sim.model->bodies) {
    const double edge = edges[body.number];
    RigidRecord& record = records.emplace_back();
    record.first = unsigned(body.first_vertex), record.vertices = unsigned(body.vertices);
    if (loose[body.number] && moves_rigidly(sim.settings, material_of(sim.settings, body.number)))
      record.slack = float(RigidContact::slack * edge);
    record.mass = float(body_mass(*sim.model, body));
  }
  sim.rigid_bodies.write(0, records.size() * sizeof(RigidRecord), records.data());
}

// Sets the activations of the step, and books what fibres gain by their change.
void activate(Sim& sim) {
  const Model& model = *sim.model;
  if (model.fibres.empty()) return;
  const Activations step = activations_of_step(model, sim.settings, simulated_time(sim));
  sim.step_block.write(offsetof(Step, activation), step.now.size() * sizeof(float), step.now.data());
  if (on_cpu(sim) || step.now == step.before) return;
  if (!sim.activation) sim.activation = make_activation(sim.system);
  sim.activation.before.write(0, step.before.size() * sizeof(float), step.before.data());
  sim.recorder.give("Held", sim.activation.records), sim.recorder.give("Before", sim.activation.before);
  sim.recorder.run(sim.activation.pass, {{"count", unsigned(sim.activation.count)}});
}

void begin_on_gpu(Sim& sim, bool moving) {
  if (moving) write_obstacles(sim);
  write_loads(sim);
  give_buffers(sim);
  activate(sim);
  plan_body_contacts(sim);
  bind_obstacles(sim.obstacles);
  if (sim.timed) sim.timer.begin();
  sim.recorder.barrier(GL_SHADER_STORAGE_BARRIER_BIT);  // a picture may still be reading these buffers
  copy_rest_metrics(sim);
  if (!sim.needs_predict) return;
  find_loads(sim, 0);
  forget_contacts(sim);
  sim.solver.predict(sim);
  sim.needs_predict = false;
}

void move_rigid_bodies(Sim& sim) {
  if (!sim.rigid_bodies) return;
  sim.recorder.give("QuantizedOut", sim.quantized[sim.read_index]);  // in place
  run_kernel(sim, sim.rigid_contact);
  give_quantized(sim);
  sim.rigid_side = 1 - sim.rigid_side;
}

}  // namespace

void break_attachments(Sim& sim) {
  std::vector<char> broken = sim.broken;
  State state;
  for (std::size_t n = 0; n < sim.model->attachments.size(); ++n) {
    const Attachment& attachment = sim.model->attachments[n];
    if (!attachment.break_force || (!broken.empty() && broken[n])) continue;
    if (state.positions.empty()) state = read_state(sim);
    const double stiffness = attachment_stiffness(attachment, *sim.model, sim.settings);
    if (!(glm::length(attachment_force(attachment, stiffness, state.positions)) > *attachment.break_force)) continue;
    broken.resize(sim.model->attachments.size());
    broken[n] = 1;
  }
  set_broken(sim, broken);
}

static void run_substep(Sim& sim, int k, bool moving) {
  if (moving) bind_next_obstacles(sim);
  move_rigid_bodies(sim);
  aim_led(sim, k);
  list_pairs(sim, k);
  lead(sim, k);
  find_loads(sim, k);
  sim.solver.substep(sim, k);
  if (are_faces_due(sim.plan, k)) move_faces_out(sim);
  resolve_body_contacts(sim, k + 1 == sim.plan.substeps);
}

static void end_step(Sim& sim) {
  ++sim.steps;
  check_step(sim);
}

static void step_on_cpu(Sim& sim, bool moving) {
  sim.solver.prepare(sim);
  begin_leading(sim);
  activate(sim);
  {
    const WithoutGl computing;
    sim.solver.substep(sim, 0);  // a CPU mode takes all substeps in one call
  }
  end_leading(sim);
  flow(sim);
  upload(sim, sim.host);
  end_step(sim);
  if (moving) write_obstacles(sim);
}

void step(Sim& sim) {
  step_unless(sim, [] { return false; });
  break_attachments(sim);
}

bool step_unless(Sim& sim, const std::function<bool()>& given_up) {
  const KeepBindings kept;  // a caller may use GL as well
  const bool moving = std::ranges::any_of(sim.model->obstacles, moves);
  if (on_cpu(sim)) return step_on_cpu(sim, moving), true;
  sim.solver.prepare(sim);  // readbacks, number of substeps, preconditioner
  begin_on_gpu(sim, moving);
  begin_leading(sim);
  for (int k = 0; k < sim.plan.substeps; ++k) {
    if (given_up()) return false;
    run_substep(sim, k, moving);
  }
  end_leading(sim);
  flow(sim);
  // Vertex fetches and copies read the state next.
  sim.recorder.barrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  if (sim.timed) sim.timer.end();
  end_step(sim);
  return true;
}

}  // namespace tetpbd
