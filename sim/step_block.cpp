// The step's block, which tells kernels the settings and the plan (Step in layout.glsl).
#include <cmath>
#include <limits>

#include "sim/model/attachments.h"
#include "sim/sim.h"
#include "sim/solvers/cpu_pbd.h"

namespace tetpbd {

// A power of two, so that multiplying by it is exact, and as small as leaves room for vertices of a constraint that are
// 16 times as far apart as the largest body is, or the most stretched constraint. It limits the precision of whatever
// is computed from quantized positions.
double choose_quantum(const Sim& sim, const State& state) {
  double reach = sim.model->size;
  std::vector<float> fineness;
  if (sim.fineness) fineness = quantum_fineness(*sim.model, sim.settings);
  for (const ConstraintList& list : sim.system.lists) {
    const std::size_t arity = std::size_t(list.arity);
#pragma omp parallel for reduction(max : reach)
    for (std::size_t c = 0; c < list.vertices.size(); c += arity)
      for (std::size_t j = 1; j < arity; ++j) {
        const double fine = fineness.empty() ? 1 : double(fineness[list.vertices[c]]);
        const double apart =
            glm::length(state.positions[list.vertices[c + j]] - state.positions[list.vertices[c]]) / fine;
        if (apart > reach && std::isfinite(apart)) reach = apart;
      }
  }
  return std::exp2(std::ceil(std::log2(reach)) - 27);
}

void write_step_block(Sim& sim, int substeps_before) {
  const Settings& s = sim.settings;
  const double h = sim.plan.h;
  const bool soft = any_material(s, compliant);
  Step block{};
  block.gravity = {0.0f, float(-s.gravity), 0.0f};
  block.h = float(h);
  block.inverse_h = float(1 / h);
  block.omega = soft ? 1.0f : float(s.omega);
  const SolverMode& mode = solver_mode(s);
  block.share = mode.leapfrog ? 0.0f : mode.in_place ? 1.0f : float(1 / s.omega);
  block.friction = float(s.friction);
  block.drag = float(s.damping);
  block.kick = substeps_before ? float(0.5 * (1 + double(sim.plan.substeps) / substeps_before)) : 1;
  block.restitution = float(s.restitution);
  block.body_size = float(sim.model->size);
  block.velocity_scale = float(std::exp(-s.damping * h));
  block.max_correction = float(longest_correction(*sim.model, s));
  block.correction_quantum = float(longest_correction(*sim.model, s) / double(1 << 30));
  block.mass_splitting = splits_masses(s);
  block.quantum = float(sim.quantum);
  block.inverse_quantum = float(1 / sim.quantum);
  const double coarse = mode.in_place ? 0 : sim.quantum;  // positions are read in full
  block.quantized_size = float(coarse / double(std::numeric_limits<float>::epsilon()));
  block.vertex_count = unsigned(sim.model->positions.size());
  block.damping = float(most_damping(s) / h);
  block.turn_limit = float(TURN_LIMIT / sim.adaptive.substep_factor);
  block.look_ahead = float(LOOK_AHEAD * s.dt);
  write_planes(*sim.model, s, block);
  const std::vector<float> active = activations_of_step(*sim.model, s, simulated_time(sim)).before;
  for (std::size_t k = 0; k < active.size(); ++k) block.activation[k / 4][glm::length_t(k % 4)] = active[k];
  for (std::size_t k = 0; k < kind_count; ++k) {
    block.stiffness[k / 4][glm::length_t(k % 4)] = float(s.stiffness[k]);
    block.compliance[k / 4][glm::length_t(k % 4)] = float(s.compliance[k] / (h * h));
  }
  sim.step_block.write(0, sizeof block, &block);
  write_obstacles(sim);
  sim.needs_predict = true;  // the quantized positions are predicted with the old h and gravity
}

}  // namespace tetpbd
