// A run of a scene for its numbers: GPU time of each step beside the error.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "app/statistics.h"
#include "sim/metrics.h"

namespace tetpbd {

struct MeasuredRun {
  RunErrors errors;
  Timing timing;
  std::vector<Measurement> measurements;  ///< one a step, the start first
};

/// Steps until a GPU that has rested while the CPU prepared the scene runs at its full clock, which takes a
/// few hundred milliseconds. Nothing on a software renderer.
void warm_up(Sim& sim);
/// Steps `steps` times and measures after each; GPU times are those of the step's passes alone. Ends early
/// when the state is not finite (its errors then say so) or `go_on(step)` says so.
MeasuredRun measure_run(Sim& sim, Metrics& metrics, long steps, const std::function<bool(long)>& go_on = {});

}  // namespace tetpbd
