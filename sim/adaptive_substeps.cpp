#include "sim/adaptive_substeps.h"

#include <algorithm>

#include "sim/gl/keep_bindings.h"
#include "sim/sim.h"

namespace tetpbd {

std::optional<std::vector<float>> poll_notes(Sim& sim) {
  AdaptiveSubsteps& w = sim.adaptive;
  const auto answer = poll_readback<float>(w.requested, w.readback, "watching the solver", true);
  sim.check.words.copy_to(w.readback, 0, 8, 8);
  w.nothing.copy_to(sim.check.words, 8, 0, 8);
  w.requested = Fence::here();
  return answer;
}

bool poll_convergence(Sim& sim) {
  AdaptiveSubsteps& w = sim.adaptive;
  const auto answer = poll_notes(sim);
  if (!answer) return false;
  w.residual = (*answer)[0], w.health = (*answer)[1];
  w.largest_residual = std::max(w.largest_residual, w.residual);
  w.least_health = std::min(w.least_health, w.health);
  return true;
}

const AdaptiveSubsteps& adaptive_values(Sim& sim) {
  const KeepBindings kept;
  if (solver_mode(sim.settings).implicit)  // the answer that is under way, then of what came since
    for (int turn = 0; turn < 2; ++turn) poll_convergence(sim);
  return sim.adaptive;
}

void forget_readbacks(Sim& sim) {
  sim.adaptive.requested = {};
  if (sim.adaptive.readback) sim.adaptive.nothing.copy_to(sim.check.words, 8, 0, 8);
}

void add_carried(Carried& all, AdaptiveSubsteps& watch, const Buffer& words) {
  if (!watch.readback) return;
  all.add(watch.readback), all.ranges.push_back({&words, 8, 8});
  all.add_values(static_cast<AdaptiveValues&>(watch));
  all.add_readback(watch.requested);
}

}  // namespace tetpbd
