// `--solver auto`: the way to solve a scene that loses least volume within a time a step, found by trying.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/scene.h"
#include "sim/sim.h"

namespace tetpbd {

/// What came of a candidate: as many substeps as fit the budget, over the first steps of the scene.
struct SolverTrial {
  Settings settings;
  double ms = 0;            ///< a step, median; GPU time
  double loss_percent = 0;  ///< largest volume loss; infinite if the state did not stay finite
};
struct SolverChoice {
  double budget_ms = 0;
  long steps = 0;  ///< of each trial
  std::vector<SolverTrial> trials{};
  std::size_t best = 0;
  bool lost_nothing = false;  ///< none of them in so few steps: chosen by what is best elsewhere
  const Settings& settings() const { return trials[best].settings; }
};

/// The budget without --budget-ms: a tenth of the time that a step simulates.
double default_budget_ms(const Settings& settings);
/// Tries mode node, one iteration a substep: averaged with two over-relaxations, with masses split.
/// Everything else stays as in `settings`. Takes a second or so on a GPU; needs a GL context.
SolverChoice choose_solver(const std::shared_ptr<const Model>& model, const Settings& settings,
                           double budget_ms, long steps);
/// For a scene that asks for it: over its first 400 steps at most. The scene then has the settings chosen.
std::optional<SolverChoice> choose_for(Scene& scene, const std::shared_ptr<const Model>& model);
/// "node, 17 substeps, omega 2.5: 0.143 ms of 0.15 ms a step, loss 2.4 % over 400 steps"
std::string describe(const SolverChoice& choice);
nlohmann::ordered_json solver_choice_json(const SolverChoice& choice);

}  // namespace tetpbd
