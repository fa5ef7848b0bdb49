#include "sim/watch.h"

#include <algorithm>

#include "sim/keep_bindings.h"
#include "sim/sim.h"

namespace tetpbd {

std::optional<std::vector<float>> read_watch(Sim& sim) {
  Watch& w = sim.watch;
  const auto answer = take<float>(w.asked, w.answer, "watching the solver", true);
  sim.check.words.copy_to(w.answer, 0, 8, 8);
  w.nothing.copy_to(sim.check.words, 8, 0, 8);
  w.asked = Fence::here();
  return answer;
}

bool read_convergence(Sim& sim) {
  Watch& w = sim.watch;
  const auto answer = read_watch(sim);
  if (!answer) return false;
  w.residual = (*answer)[0], w.health = (*answer)[1];
  w.largest_residual = std::max(w.largest_residual, w.residual);
  w.least_health = std::min(w.least_health, w.health);
  return true;
}

const Watch& watched(Sim& sim) {
  const KeepBindings kept;
  if (mode_of(sim.settings).implicit)  // the answer that is under way, then of what came since
    for (int turn = 0; turn < 2; ++turn) read_convergence(sim);
  return sim.watch;
}

void forget_answers(Sim& sim) {
  sim.watch.asked = {};
  if (sim.watch.answer) sim.watch.nothing.copy_to(sim.check.words, 8, 0, 8);
}

void add_carried(Carried& all, Watch& watch, const Buffer& words) {
  if (!watch.answer) return;
  all.add(watch.answer), all.ranges.push_back({&words, 8, 8});
  all.add_values(static_cast<WatchNumbers&>(watch));
  all.add_readback(watch.asked);
}

}  // namespace tetpbd
