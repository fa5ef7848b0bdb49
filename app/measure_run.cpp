#include "app/measure_run.h"

#include <algorithm>
#include <chrono>

#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

void warm_up(Sim& sim) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  while (!is_software_renderer() && std::chrono::duration<double>(Clock::now() - begin).count() < 0.3 &&
         !interrupted()) {
    step(sim);
    glFinish();
  }
}

MeasuredRun measure_run(Sim& sim, Metrics& metrics, long steps, const std::function<bool(long)>& go_on) {
  using Clock = std::chrono::steady_clock;
  MeasuredRun run;
  sim.timed = true;
  const auto take = [&](const std::optional<Measurement>& measurement) {
    if (!measurement) return false;
    add_measurement(run.errors, *measurement, sim);
    run.measurements.push_back(*measurement);
    return true;
  };
  measure(metrics, sim);
  for (long s = 1; s <= steps; ++s) {
    const auto begin = Clock::now();
    step(sim);
    glFinish();
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    if (check_finite(sim, true)) break;
    run.timing.wall_ms.add(seconds * 1e3);
    run.timing.total_s += seconds;
    measure(metrics, sim);
    while (take(collect(metrics))) {
    }
    while (const auto ms = sim.timer.poll()) run.timing.gpu_ms.add(*ms);
    if (interrupted()) throw Interrupted();
    if (!run.errors.finite || (go_on && !go_on(s))) break;
  }
  while (take(collect(metrics, true))) {
  }
  while (const auto ms = sim.timer.poll(true)) run.timing.gpu_ms.add(*ms);
  run.errors.non_finite = check_finite(sim, true);
  run.errors.finite = run.errors.finite && !run.errors.non_finite;
  return run;
}

}  // namespace tetpbd
