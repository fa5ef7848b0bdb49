#include "app/lab/auto_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "app/lab/reference_command.h"
#include "app/lab/run.h"
#include "app/lab/sweep.h"
#include "sim/contact/pairs.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// Of the first trial: a slow machine compares fewer steps, though not so few that nothing has happened yet.
double most_seconds() { return is_software_renderer() ? 8 : 3; }
constexpr int most_substeps = 1000;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double finer = 8;        // times the substeps, of the run that stands in for the reference motion
constexpr double no_error = 1e-3;  // percent: below it settings are equally right
constexpr double fitting = 1.05;   // of the budget: times differ by as much from run to run

// One iteration per substep first, which is on the front wherever it was measured (docs/results.md).
std::vector<Settings> candidates(const Settings& own) {
  Settings base = own;
  set_mode(base, "node", "auto");
  base.iterations = base.substeps = 1;
  std::vector<Settings> all;
  if (any_material(own, compliant)) {
    all = {base};  // masses are split; over-relaxation leaves their compliance alone and gains little
  } else {
    base.omega = 1.5, base.mass_splitting = true;
    all.push_back(base);
    base.mass_splitting = false;
    all.push_back(base);
    base.omega = 2.5;
    all.push_back(base);
  }
  base = all[0];
  set_mode(base, "cpu-fast", "auto");
  all.push_back(base);
  if (has_forces(own)) {
    set_mode(base, "explicit", "auto");
    all.push_back(base);
    apply_preset(base, solver_presets(), "newton");
    all.push_back(base);
  }
  all.push_back(own);
  return all;
}

/// Steps until that many seconds have passed, from the start.
MeasuredRun time_steps(Sim& sim, double seconds, const std::function<void(long)>& stepped) {
  reset(sim);
  const MeasuredRun run =
      run_to_end(sim, nullptr, std::numeric_limits<long>::max(), {.most_seconds = seconds, .stepped = stepped});
  if (interrupted()) throw Interrupted();
  return run;
}

/// As many substeps as fit the budget, from one substep's time, then from what so many took.
void fit_substeps(Sim& sim, Settings& settings, double budget_ms, const std::function<void(long)>& stepped) {
  for (int round = 0; round < 2; ++round) {
    const MeasuredRun run = time_steps(sim, is_software_renderer() ? 0 : 0.03, stepped);
    const double substeps = plan_for(settings).substeps * budget_ms / step_ms(run);
    settings.substeps = int(std::clamp(substeps, 1.0, double(most_substeps)));
    apply_settings(sim, settings);
  }
}

/// What stands in for the reference motion: leapfrog at a tenth of what is stable where there are forces and that
/// takes no longer, else more substeps.
Sim finer_than(const Settings& settings, const std::shared_ptr<const Model>& model) {
  Settings fine = settings;
  fine.substeps = int(std::min(finer * plan_for(fine).substeps, double(most_substeps)));
  if (has_forces(settings)) {
    Settings leapfrog = settings;
    set_mode(leapfrog, "explicit", "auto");
    leapfrog.stability = 0.1, leapfrog.mass_scaling = 0;
    Sim sim = create_sim(model, leapfrog);
    if (sim.plan.substeps <= fine.substeps) return sim;
  }
  return create_sim(model, fine);
}

}  // namespace

Motion motion_of_run(Sim& sim, long steps, const std::function<void(long)>& stepped) {
  Motion motion;
  const auto keep = [&](long step) {
    motion.kept.push_back(step);
    motion.positions.push_back(read_state(sim).positions);
  };
  keep(0);
  const long every = std::max(1L, steps / 20);
  run_to_end(sim, nullptr, steps, {.stepped = [&](long s) {
               if (s % every == 0 || s == steps) keep(s);
               if (stepped) stepped(s);
             }});
  return motion;
}

double default_budget_ms(const Settings& settings) { return 100 * settings.dt; }

namespace {

/// What candidates are tried on, and what is known so far.
struct Race {
  const std::shared_ptr<const Model>& model;
  const Settings& settings;
  double budget_ms;
  const SolverProgress& progress;
  std::size_t candidates = 1;
  SolverChoice choice{};
  std::optional<Motion> right{};
  std::chrono::steady_clock::time_point told{};
};

// Part of the candidate that is being tried, the last of the trials.
void tell(Race& race, double part) {
  if (interrupted()) throw Interrupted();
  race.told = std::chrono::steady_clock::now();
  const std::size_t number = race.choice.trials.size();
  if (race.progress)
    race.progress(
        fmt::format("{}, candidate {} of {}", race.choice.trials.back().settings.mode, number, race.candidates),
        (double(number) - 1 + part) / double(race.candidates));
}

// RunPlan::stepped, of a run that takes a trial from one part of it to another.
std::function<void(long)> tell_steps(Race& race, double from, double to, long steps) {
  return [&race, from, to, steps](long s) {
    if (seconds_since(race.told) > 0.05) tell(race, from + (to - from) * std::min(1.0, double(s) / double(steps)));
  };
}

// By what trials are judged. What a slow machine can afford: the reference takes as long as all trials together.
void find_standard(Race& race, const Settings& trial, int substeps, long steps) {
  const Settings& settings = race.settings;
  SolverChoice& choice = race.choice;
  if (const auto found = rigid_motion(*race.model, settings, steps)) {
    race.right = found, choice.judged = "motion";
  } else if (any_material(settings, compliant) || all_materials(settings, hard)) {
    Sim fine = finer_than(trial, race.model);
    const double seconds = 1e-3 * fine.plan.substeps / double(substeps) * race.budget_ms;
    choice.steps = std::clamp(long(2 * most_seconds() / seconds), 2L, steps);
    race.right = motion_of_run(fine, choice.steps, tell_steps(race, 0.2, 0.6, choice.steps));
    choice.judged = "finer steps";
  } else {
    choice.judged = "volume";
  }
}

void judge_trial(Race& race, Sim& sim, SolverTrial& trial, bool first) {
  SolverChoice& choice = race.choice;
  apply_settings(sim, trial.settings);
  reset(sim);
  trial.plan = sim.plan;
  Metrics metrics = create_metrics(sim);
  const double enough = first ? most_seconds() : 2e-3 * race.budget_ms * double(choice.steps) + 0.5;
  const MeasuredRun run =
      run_to_end(sim, &metrics, choice.steps,
                 {.most_seconds = enough, .stepped = tell_steps(race, 0.6, 1, choice.steps), .standard = race.right});
  if (interrupted()) throw Interrupted();
  if (first && run.errors.finite) choice.steps = run.steps;
  trial.ms = step_ms(run);
  trial.fits = trial.ms <= fitting * race.budget_ms && (first || run.steps == choice.steps);
  trial.error = !run.errors.finite ? infinity : run.motion ? 100 * run.motion->rms : run.errors.max_volume_loss_percent;
}

void try_candidate(Race& race, const Settings& candidate) {
  SolverChoice& choice = race.choice;
  const long steps = choice.steps;
  const bool first = choice.trials.empty(), as_it_is = candidate == race.settings || solver_mode(candidate).leapfrog;
  SolverTrial& trial = choice.trials.emplace_back(SolverTrial{candidate});
  tell(race, 0);
  Sim sim = create_sim(race.model, candidate);
  if (first) warm_up(sim);
  time_steps(sim, 0, {});  // the first of a new solver is not like the others
  if (!as_it_is) fit_substeps(sim, trial.settings, race.budget_ms, tell_steps(race, 0, 0.2, 1000));
  if (first && !race.right) find_standard(race, trial.settings, sim.plan.substeps, steps);
  for (int attempt = 1;; ++attempt) {
    judge_trial(race, sim, trial, first);
    // In contact a step takes longer than those it was fitted to.
    if (trial.fits || as_it_is || trial.settings.substeps == 1 || attempt == 3) break;
    trial.settings.substeps = std::max(1, int(trial.settings.substeps * std::min(0.95, race.budget_ms / trial.ms)));
  }
  // Errors that agree to a hundredth are the same: then the plainer one.
  const SolverTrial& best = choice.trials[choice.best];
  const bool righter = best.error > no_error && trial.error < 0.99 * best.error;
  if (trial.fits && (!best.fits || righter)) choice.best = choice.trials.size() - 1;
}

}  // namespace

SolverChoice choose_solver(const std::shared_ptr<const Model>& model, const Settings& settings, double budget_ms,
                           long steps, const SolverProgress& progress) {
  if (any_material(settings, smoothed) &&
      !solver_mode(settings).smoothed) {  // what is right is of smoothed tets, as asked for
    Settings own = settings;
    set_mode(own, "newton", "auto");
    return choose_solver(model, own, budget_ms, steps, progress);
  }
  Race race{model, settings, budget_ms, progress};
  SolverChoice& choice = race.choice;
  choice.budget_ms = budget_ms, choice.steps = steps;
  race.right = right_motion(*model, settings);
  if (race.right) choice.judged = "motion";
  std::vector<Settings> all = candidates(settings);
  if (any_material(settings, smoothed))
    std::erase_if(all, [](const Settings& candidate) { return !solver_mode(candidate).smoothed; });
  race.candidates = all.size();
  for (const Settings& candidate : all) try_candidate(race, candidate);
  if (!choice.trials[choice.best].fits) {
    const auto& quickest = *std::ranges::min_element(choice.trials, {}, &SolverTrial::ms);
    throw Error("nothing fits the budget",
                fmt::format("{:.3g} ms a step; the quickest, {}, takes {:.3g} ms", budget_ms, quickest.settings.mode,
                            quickest.ms),
                "raise --budget-ms, or take fewer tets", 1);
  }
  return choice;
}

namespace {

constexpr double hard_impact = 0.5;  // of Young's modulus; a body of 10 kPa that falls 1 m hits with 2

// The stagnation pressure rho v^2 of the hardest fall to the ground, over the body's Young's modulus.
double impact_strain(const Model& model, const Settings& settings) {
  double most = 0;
  for (const Body& body : model.bodies) {
    const Material& material = material_of(settings, body.number);
    if (!settings.ground || body.is_sheet() || material.material == "none") continue;
    double fastest = 0;
    bool held = false;
    for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v) {
      fastest = std::max(fastest, glm::dot(model.velocities[v], model.velocities[v]));
      held = held || model.inverse_masses[v] == 0;
    }
    if (held) continue;
    const double volume = filled_volume(body_mesh(model, body));
    const double drop = std::max(0.0, body_bounds(body, model.positions).low.y - settings.ground_height);
    const double square = fastest + 2 * std::max(0.0, settings.gravity) * drop;
    most = std::max(most, body_mass(model, body) / volume * square / material.young_modulus);
  }
  return most;
}

}  // namespace

std::optional<std::string> choose_by_rule(Scene& scene, const Model& model) {
  if (!std::exchange(scene.mode_open, false)) return std::nullopt;
  Settings& s = scene.settings;
  if (!has_forces(s)) {
    if (!scene.by_device || !all_materials(s, hard) || !is_software_renderer()) return std::nullopt;
    set_mode(s, "cpu-fast", scene.name);
    return "cpu-fast: on a software renderer faster than node and nearer to what is right";
  }
  double spin = 0;
  for (const BodyDescription& body : scene.bodies) spin = std::max(spin, glm::length(body.spin));
  // Four times as many where newton would take four times its own (sim/adaptive_substeps.h).
  const double wanted = explicit_substeps(model, s),
               most = (is_software_renderer() ? 20 : 40) * (0.5 * s.dt * spin > TURN_LIMIT ? refined_substeps : 1);
  // Of bodies that touch newton is the less right, and takes four times its substeps as well. What an impact presses
  // flat keeps inverted tets in explicit, where nothing turns them back.
  const bool touching = bodies_touch(model, s), flat = !touching && impact_strain(model, s) > hard_impact;
  if (!flat && wanted <= most * (touching ? refined_substeps : 1)) {
    set_mode(s, "explicit", scene.name);
    return fmt::format("explicit, about {:g} substep{}", wanted, wanted == 1 ? "" : "s");
  }
  set_mode(s, "newton", scene.name);
  // What truncated iterations leave turns a body that spins: so many keep that to a few percent.
  // Very stiff bodies land without a crush only in short substeps, of which there are four times as many then.
  s.substeps = wanted <= 400 && !flat ? 2 : 4;
  s.iterations = wanted <= 40 && !flat ? 4 : wanted <= 128 ? 8 : 16;
  const std::string why = flat && wanted <= most ? "the impact would press the body flat"
                                                 : fmt::format("explicit would take {:g}, over {:g}", wanted, most);
  return fmt::format("newton, {} substeps of {} iterations: {}", s.substeps, s.iterations, why);
}

std::optional<SolverChoice> choose_and_say(Scene& scene, const std::shared_ptr<const Model>& model,
                                           const SolverProgress& progress) {
  if (const auto rule = choose_by_rule(scene, *model)) fmt::print("solver: {}\n", *rule);
  std::optional<SolverChoice> choice;
  {
    Progress line("", 100);
    choice = choose_for(scene, model, progress ? progress : SolverProgress([&](const std::string& what, double part) {
                          line.label = fmt::format("trying {}, per cent:", what);
                          line.update(std::lround(100 * part));
                        }));
  }
  if (choice) fmt::print("solver: {}\n", describe(*choice));
  return choice;
}

std::optional<SolverChoice> choose_for(Scene& scene, const std::shared_ptr<const Model>& model,
                                       const SolverProgress& progress) {
  if (!scene.budget_ms) return std::nullopt;
  const long steps = std::min(duration_in_steps(scene), 400L);
  SolverChoice choice = choose_solver(model, scene.settings, *scene.budget_ms, steps, progress);
  scene.settings = choice.settings();
  scene.budget_ms.reset();
  return choice;
}

std::string describe(const SolverChoice& choice) {
  const SolverTrial& best = choice.trials[choice.best];
  const Settings& s = best.settings;
  const Plan& plan = best.plan;
  return fmt::format(
      "{}, {} x {} (substeps x iterations), omega {:g}{}: {:.3g} ms of {:.3g} ms a step, {} over {} steps", s.mode,
      plan.substeps, plan.iterations, s.omega, s.mass_splitting && !any_material(s, compliant) ? ", masses split" : "",
      best.ms, choice.budget_ms,
      fmt::format(fmt::runtime(choice.judged == "motion"        ? "{:.2g} % from the reference motion"
                               : choice.judged == "finer steps" ? "{:.2g} % from finer steps"
                                                                : "loss {:.3g} %"),
                  best.error),
      choice.steps);
}

nlohmann::ordered_json solver_choice_json(const SolverChoice& choice) {
  ordered_json trials = ordered_json::array();
  for (const SolverTrial& trial : choice.trials)
    trials.push_back({{"mode", trial.settings.mode},
                      {"omega", trial.settings.omega},
                      {"mass_splitting", trial.settings.mass_splitting},
                      {"iterations", trial.plan.iterations},
                      {"substeps", trial.plan.substeps},
                      {"ms_per_step", trial.ms},
                      {"fits", trial.fits},
                      {"error_percent", trial.error}});
  return {{"budget_ms", choice.budget_ms},
          {"steps", choice.steps},
          {"judged_by", choice.judged},
          {"chosen", choice.best},
          {"trials", trials}};
}

}  // namespace tetpbd
