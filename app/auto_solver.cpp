#include "app/auto_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "app/run_loop.h"
#include "app/sweep.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

constexpr double most_seconds = 3;  // of the first trial: a slow machine compares fewer steps
constexpr double most_substeps = 1000, infinity = std::numeric_limits<double>::infinity();

// On the front wherever it was measured (docs/results.md): one iteration a substep, never several.
std::vector<Settings> candidates(Settings base) {
  set_mode(base, "node", "auto");
  base.iterations = base.substeps = 1;
  if (compliant(base)) return {base};  // over-relaxation does not apply
  std::vector<Settings> all = combinations(base, {.omegas = {1.5, 2.5}});
  all.push_back(all.back());
  all.back().mass_splitting = true;
  return all;
}

/// As many substeps as fit the budget, from one substep's time, then from what so many took.
void fit_substeps(Sim& sim, Settings& settings, double budget_ms) {
  for (int round = 0; round < 2; ++round) {
    reset(sim);
    const double seconds = is_software_renderer() ? 0 : 0.03;
    const MeasuredRun run =
        run_loop(sim, nullptr, std::numeric_limits<long>::max(), {.most_seconds = seconds});
    if (interrupted()) throw Interrupted();
    const double fitting = settings.substeps * budget_ms / median(run.gpu_ms);
    settings.substeps = int(std::clamp(fitting, 1.0, most_substeps));
    apply_settings(sim, settings);
  }
}

}  // namespace

double default_budget_ms(const Settings& settings) { return 100 * settings.dt; }

SolverChoice choose_solver(const std::shared_ptr<const Model>& model, const Settings& settings,
                           double budget_ms, long steps) {
  SolverChoice choice{budget_ms, steps};
  for (const Settings& candidate : candidates(settings)) {
    const bool first = choice.trials.empty();
    SolverTrial& trial = choice.trials.emplace_back(SolverTrial{candidate});
    Sim sim = create_sim(model, candidate);
    if (first) warm_up(sim);
    step(sim);  // the first of a new solver is not like the others
    fit_substeps(sim, trial.settings, budget_ms);
    reset(sim);
    Metrics metrics = create_metrics(*model, sim.system);
    const MeasuredRun run =
        run_loop(sim, &metrics, choice.steps, {.most_seconds = first ? most_seconds : infinity});
    if (interrupted()) throw Interrupted();
    if (first && run.errors.finite) choice.steps = run.steps;
    trial.ms = median(run.gpu_ms);
    trial.loss_percent = run.errors.finite ? run.errors.max_volume_loss_percent : infinity;
    // Losses that agree to a hundredth are the same: then the plainer one.
    if (trial.loss_percent < 0.99 * choice.trials[choice.best].loss_percent)
      choice.best = choice.trials.size() - 1;
  }
  // Where nothing was lost the trials say nothing: a body that has not fallen yet, a machine too slow to wait
  // for it. Then the first of them is taken.
  choice.lost_nothing = std::ranges::all_of(
      choice.trials, [](double loss) { return loss < 0.01; }, &SolverTrial::loss_percent);
  if (choice.lost_nothing) choice.best = 0;
  return choice;
}

std::optional<SolverChoice> choose_for(Scene& scene, const std::shared_ptr<const Model>& model) {
  if (!scene.budget_ms) return std::nullopt;
  const long steps = std::min(duration_in_steps(scene), 400L);
  SolverChoice choice = choose_solver(model, scene.settings, *scene.budget_ms, steps);
  scene.settings = choice.settings();
  scene.budget_ms.reset();
  return choice;
}

std::string describe(const SolverChoice& choice) {
  const SolverTrial& best = choice.trials[choice.best];
  const Settings& s = best.settings;
  const std::string loss = choice.lost_nothing
                               ? fmt::format("none lost volume in {} steps", choice.steps)
                               : fmt::format("loss {:.3g} % over {} steps", best.loss_percent, choice.steps);
  return fmt::format("{}, {} substep{}, omega {:g}{}: {:.3g} ms of {:.3g} ms a step, {}", s.mode, s.substeps,
                     s.substeps == 1 ? "" : "s", s.omega, s.mass_splitting ? ", masses split" : "", best.ms,
                     choice.budget_ms, loss);
}

nlohmann::ordered_json solver_choice_json(const SolverChoice& choice) {
  ordered_json trials = ordered_json::array();
  for (const SolverTrial& trial : choice.trials)
    trials.push_back({{"mode", trial.settings.mode},
                      {"omega", trial.settings.omega},
                      {"mass_splitting", trial.settings.mass_splitting},
                      {"iterations", trial.settings.iterations},
                      {"substeps", trial.settings.substeps},
                      {"gpu_ms_per_step", trial.ms},
                      {"max_volume_loss_percent", trial.loss_percent}});
  return {
      {"budget_ms", choice.budget_ms}, {"steps", choice.steps}, {"chosen", choice.best}, {"trials", trials}};
}

}  // namespace tetpbd
