// `--solver auto`: the way to solve a scene whose motion is nearest to the right one within a time a step,
// found by trying.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/scene.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"

namespace tetpbd {

/// What came of a candidate: as many substeps as fit the budget, over the first steps of the scene.
struct SolverTrial {
  Settings settings;
  Plan plan{};
  double ms = 0;     ///< a step, median; GPU time, of modes on the CPU wall time
  double error = 0;  ///< as `judged` says, percent; infinite if the state did not stay finite
  bool fits = true;  ///< the budget
};
struct SolverChoice {
  double budget_ms = 0;
  long steps = 0;      ///< of each trial
  std::string judged;  ///< by what: "motion", "finer steps" or "volume"
  std::vector<SolverTrial> trials{};
  std::size_t best = 0;
  const Settings& settings() const { return trials[best].settings; }
};

/// Is told what is tried and which part of all is done: before each candidate, and every now and then during its
/// steps. It may throw Interrupted, after which nothing has changed.
using SolverProgress = std::function<void(const std::string& what, double part)>;

/// Positions of a run, some twenty times on its way, for others to be held against. `stepped` as in RunPlan.
Motion motion_of_run(Sim& sim, long steps, const std::function<void(long)>& stepped = {});
/// The budget without --budget-ms: a tenth of the time that a step simulates.
double default_budget_ms(const Settings& settings);
/// Tries the scene's own setting, and one iteration per substep in mode node, with two over-relaxations and
/// with masses split, and in mode cpu-fast. Held against the reference motion (RMS over the steps) where it is in
/// the cache or that of rigid bodies; else with compliance or k = 1 against a run in much finer steps; else
/// by the largest volume loss. Everything else stays as in `settings`. Some seconds; needs a GL context.
/// Throws Error where nothing fits the budget.
SolverChoice choose_solver(const std::shared_ptr<const Model>& model, const Settings& settings, double budget_ms,
                           long steps, const SolverProgress& progress = {});
/// The mode of bodies that have forces, where nobody says one: `explicit` up to 40 substeps, 20 on a software
/// renderer, else `newton` in two substeps of 4 iterations, 8 from 40 such substeps on, 16 from 128, 32 from
/// 400; `newton` as well where a body falls so far that the impact presses it flat. By what was measured
/// (docs/results.md), without a race. Of hard ones `cpu-fast` on a software renderer, where the scene lets the device
/// choose. What it took; nothing otherwise.
std::optional<std::string> choose_by_rule(Scene& scene, const Model& model);
/// For a scene that asks for it: over its first 400 steps at most. The scene then has the settings chosen.
std::optional<SolverChoice> choose_for(Scene& scene, const std::shared_ptr<const Model>& model,
                                       const SolverProgress& progress = {});
/// Both, and says on standard output what was chosen. Without `progress` a terminal shows it.
std::optional<SolverChoice> choose_and_say(Scene& scene, const std::shared_ptr<const Model>& model,
                                           const SolverProgress& progress = {});
/// "node, 17 x 1 (substeps x iterations), omega 2.5: 0.143 ms of 0.15 ms a step, 0.02 % from the reference motion over
/// 160 steps"
std::string describe(const SolverChoice& choice);
nlohmann::ordered_json solver_choice_json(const SolverChoice& choice);

}  // namespace tetpbd
