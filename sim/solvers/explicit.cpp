// Leapfrog on the GPU (method.md, "Leapfrog: explicit"): a substep is one dispatch, of smoothed tets two, and
// there are as many as stay stable. As a body deforms it may become stiffer, and a substep that was stable too long. So
// kernels note the stiffest constraint of a step, and the readback comes always as many steps later, so that a run is
// the same every time.
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "sim/error.h"
#include "sim/model/material.h"
#include "sim/reference/leapfrog.h"
#include "sim/sim.h"
#include "sim/solvers/jacobi.h"
#include "sim/solvers/rings.h"

namespace tetpbd {

double stiffening_for(double stiffer, double stability) {
  // The largest eigenvalue rises by up to 1.6 times as much as the bound does (a test has stretched, squeezed, sheared
  // and turned over blocks up to a Poisson's ratio of 0.49), and the body goes on deforming until the readback.
  constexpr double rise = 1.6, safe = 0.9, most = 32;
  const double largest = 1 + rise * std::max(0.0, stiffer - 1);
  const double needed = std::sqrt(largest) * stability / std::max(safe, stability);
  if (!(needed > 1)) return 1;
  return std::min(most, std::exp2(std::ceil(4 * std::log2(needed)) / 4));
}

// Contact moves single vertices, which averages of smoothed tets hardly resist until tets do, and that is late: of
// eight balls thrown at each other, 7700 corrections in 240 steps went too far at the whole of the default.
static double kept_stability(const Model& model, const ConstraintSystem& system, const Settings& settings) {
  return settings.stability * (has_averages(system) && bodies_touch(model, settings) ? 0.5 : 1);
}

double explicit_substeps(const Model& model, Settings s) {
  s.mode = "explicit";
  const ConstraintSystem system = build_constraints(model, s);
  const double longest = scale_masses({model, system, s, model.inverse_masses}, 12).longest_step;
  return std::max(1.0, std::ceil(s.dt / (kept_stability(model, system, s) * longest)));
}

namespace {

ReferenceInput reference_input(const Sim& sim) { return {*sim.model, sim.system, sim.settings, sim.inverse_masses}; }

// The value that kernels note (NOTE_STIFFNESS), in a state.
double stiffest(const Sim& sim, const State& state) {
  if (state.rest_metrics.empty())
    return stiffest_constraint(reference_input(sim), sim.settings.compliance, state.positions);
  ConstraintSystem flowed = sim.system;
  put_rest_metrics(flowed.lists[index_of<NeoHookean>], sim.model->rest, state.rest_metrics);
  return stiffest_constraint({*sim.model, flowed, sim.settings, sim.inverse_masses}, sim.settings.compliance,
                             state.positions);
}

// Takes as many substeps as are asked for, or more where stability needs them: a stable one is `longest` at rest, else
// 1 / stiffening of that.
Plan make_plan(const Sim& sim, double longest, double stiffening) {
  const Settings& settings = sim.settings;
  const double at_rest =
      longest > 0 ? settings.dt / (kept_stability(*sim.model, sim.system, sim.settings) * longest) : 0;
  constexpr double most = 100000;
  const double wanted = at_rest > most ? at_rest : std::min(at_rest * stiffening, most);
  if (wanted > most)
    throw Error("the body is too stiff for mode explicit", fmt::format("a step takes {:.3g} substeps", wanted),
                fmt::format("at most {:g}: use another mode, a softer material or a shorter dt", most));
  Plan plan = plan_for(settings);
  plan.substeps = std::max(plan.substeps, int(std::ceil(wanted)));
  plan.h = settings.dt / plan.substeps;
  return plan;
}

// Where the length of a substep changes, the next change of velocities spans half of either length (PHASE_CHANGED).
void set_stiffening(Sim& sim, double stiffening) {
  const int before = sim.plan.substeps;
  sim.adaptive.stiffening = stiffening;
  sim.plan = make_plan(sim, sim.longest_substep, stiffening);
  if (sim.plan.substeps == before) return;
  sim.adaptive.changed = true;
  write_step_block(sim, before);
}

void watch_stiffness(Sim& sim) {
  AdaptiveSubsteps& w = sim.adaptive;
  const auto notes = poll_notes(sim);
  const double noted_h = std::exchange(w.noted_h, sim.plan.h);
  if (!notes || !(notes->front() > 0) || !std::isfinite(notes->front())) return;  // 0: nothing was noted yet
  const double stiffer = notes->front() / (noted_h * noted_h * w.at_rest);
  const double next = stiffer + std::max(0.0, stiffer - w.stiffer);  // by the next readback, if it goes on so
  w.stiffer = stiffer;
  const double needed = stiffening_for(next, kept_stability(*sim.model, sim.system, sim.settings));
  // The number of substeps rises at once, and falls in small steps, because bodies swing.
  w.calm_readbacks = needed < w.stiffening ? w.calm_readbacks + 1 : 0;
  if (needed > w.stiffening) set_stiffening(sim, needed);
  if (w.calm_readbacks == 16) w.calm_readbacks = 0, set_stiffening(sim, std::max(1.0, w.stiffening * std::exp2(-0.25)));
}

void start(Sim& sim, const State& state) {
  AdaptiveSubsteps& w = sim.adaptive;
  w = AdaptiveValues{.at_rest = w.at_rest};
  if (w.at_rest > 0) {
    const double now = stiffest(sim, state) / w.at_rest;
    w.stiffer = std::isfinite(now) ? now : 1;
    w.stiffening = stiffening_for(w.stiffer, kept_stability(*sim.model, sim.system, sim.settings));
  }
  sim.plan = make_plan(sim, sim.longest_substep, w.stiffening);
}

void retune(Sim& sim, const Settings* before) {
  const Settings& now = sim.settings;
  const bool same = before && before->compliance == now.compliance &&
                    before->constraint_damping == now.constraint_damping && before->mass_scaling == now.mass_scaling;
  if (same) {
    sim.plan = make_plan(sim, sim.longest_substep, sim.adaptive.stiffening);
    return;
  }
  ScaledMasses scaled = scale_masses({*sim.model, sim.system, now, sim.model->inverse_masses}, 30);
  sim.plan = make_plan(sim, scaled.longest_step, sim.adaptive.stiffening);
  sim.longest_substep = scaled.longest_step, sim.mass_scaling = scaled, sim.masses = std::move(scaled.masses);
  for (std::size_t v = 0; v < sim.masses.size(); ++v)
    if (!is_pinned(sim, std::uint32_t(v))) sim.inverse_masses[v] = 1 / sim.masses[v];
  sim.adaptive.at_rest = stiffest(sim, {sim.model->rest.positions, {}});
}

}  // namespace

Solver create_explicit_solver(const SolverInput& input) {
  Solver solver;
  const auto pass = std::make_shared<Pass>(make_vertex_patch_pass(solver, input, "solvers/explicit.comp", false));
  const auto smoothing =
      std::make_shared<Pass>(has_averages(input.system) ? make_smoothing_pass(solver, input) : Pass{});
  add_prediction(solver, input);
  solver.watches = true;
  solver.start = start;
  solver.retune = retune;
  solver.prepare = [](Sim& sim) {
    AdaptiveSubsteps& w = sim.adaptive;
    if (!w.readback) return;
    if (sim.steps % AdaptiveSubsteps::every == 0 && w.at_rest > 0) watch_stiffness(sim);
    w.most_substeps = std::max(w.most_substeps, sim.plan.substeps);
  };
  solver.substep = [pass, smoothing](Sim& sim, int substep) {
    if (*smoothing) run_kernel(sim, *smoothing);
    unsigned phases = PHASE_PREDICT | PHASE_SOLVE | PHASE_FINISH | sim.pairs.phases;
    if (substep == 0 && sim.adaptive.readback)
      phases |= PHASE_WATCH | (std::exchange(sim.adaptive.changed, false) ? PHASE_CHANGED : 0u);
    run_kernel(sim, *pass, phases, "", 2 * sim.model->positions.size() * sizeof(Velocity));
    turn_quantized(sim);
  };
  return solver;
}

}  // namespace tetpbd
