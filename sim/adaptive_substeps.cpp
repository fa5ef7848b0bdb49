#include "sim/adaptive_substeps.h"

#include <algorithm>

#include "sim/gl/keep_bindings.h"
#include "sim/sim.h"

namespace tetpbd {

std::optional<std::vector<float>> poll_notes(Sim& sim) {
  AdaptiveSubsteps& a = sim.adaptive;
  const auto values = poll_readback<float>(a.requested, a.readback, "watching the solver", true);
  sim.check.words.copy_to(a.readback, 0, 8, 8);
  a.nothing.copy_to(sim.check.words, 8, 0, 8);
  a.requested = Fence::here();
  return values;
}

bool poll_convergence(Sim& sim) {
  AdaptiveSubsteps& a = sim.adaptive;
  const auto values = poll_notes(sim);
  if (!values) return false;
  a.residual = (*values)[0], a.health = (*values)[1];
  a.largest_residual = std::max(a.largest_residual, a.residual);
  a.least_health = std::min(a.least_health, a.health);
  return true;
}

const AdaptiveSubsteps& adaptive_values(Sim& sim) {
  const KeepBindings kept;
  if (solver_mode(sim.settings).implicit)  // first what was requested before, then what steps recorded since
    for (int turn = 0; turn < 2; ++turn) poll_convergence(sim);
  return sim.adaptive;
}

void forget_readbacks(Sim& sim) {
  sim.adaptive.requested = {};
  if (sim.adaptive.readback) sim.adaptive.nothing.copy_to(sim.check.words, 8, 0, 8);
}

void add_carried(Carried& all, AdaptiveSubsteps& adaptive, const Buffer& words) {
  if (!adaptive.readback) return;
  all.add(adaptive.readback), all.ranges.push_back({&words, 8, 8});
  all.add_values(static_cast<AdaptiveValues&>(adaptive));
  all.add_readback(adaptive.requested);
}

}  // namespace tetpbd
