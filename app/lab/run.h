// The one loop that steps for numbers: a run can be advanced for a while, gone on with later, and ends in the time of
// its steps beside their errors. Commands run to the end; the map in the window goes on a little in every frame.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "app/lab/progress.h"
#include "sim/measure/metrics.h"
#include "sim/reference/total_error.h"

namespace tetpbd {

/// Of a film in real time.
inline long steps_per_frame(double dt) { return std::max(1L, std::lround(1.0 / 30 / dt)); }

/// The value that this part of them does not exceed; NaN where there are none.
double percentile(std::vector<double> values, double part);
inline double median(const std::vector<double>& values) { return percentile(values, 0.5); }

/// What runs are held against, at the instants it has.
struct Standard {
  const Motion* right = nullptr;
  const TotalError* total = nullptr;
  Standard(const Motion* motion = nullptr, const TotalError* error = nullptr) : right(motion), total(error) {}
  Standard(const std::optional<Motion>& motion) : right(motion ? &*motion : nullptr) {}
};

/// How a run keeps up with the GPU.
enum class Pace {
  each_step,  ///< waits for each step, and times it
  queued,     ///< waits at the end alone, and times all steps together
  batches,    ///< never waits: advance() returns while the GPU is behind, and looks at states between batches alone
};

struct RunPlan {
  long measure_every = 1;  ///< steps; the start and the last step are measured in any case
  long compare_every = 1;  ///< steps between comparisons with the standard, likewise
  double most_seconds = std::numeric_limits<double>::infinity();  ///< ends then, after one step at least
  Pace pace = Pace::each_step;
  bool check_crossings = false;         ///< ends a run where surfaces cut each other that did not at the start
  bool timed = true;                    ///< GPU time of each step; its queries are GL objects that come and go
  std::function<void(long)> stepped{};  ///< after each step; what it throws ends the run
  Standard standard{};
  /// Takes each measurement as it arrives; without, the run keeps them.
  std::function<void(const Measurement&, const RunErrors&)> measured{};
};

struct MeasuredRun {
  RunErrors errors;
  std::optional<MotionError> motion, total;  ///< of the instants up to the last step, where there is a standard
  std::vector<std::array<double, 2>> motion_over_time, total_over_time;  ///< s, distance over the size
  std::vector<Measurement> measurements;                                 ///< the start first
  std::vector<double> gpu_ms, wall_ms;  ///< a step; GPU time is that of its passes alone
  double seconds = 0;                   ///< of all steps, without what came between those waited for
  long steps = 0;                       ///< taken, and finite
  int substeps = 0;                     ///< of a step
  std::optional<std::uint64_t> hash{};  ///< of the state at the end; none where that is not finite
};

/// What a step took: GPU time, or wall time where the CPU does the work; median.
double step_ms(const MeasuredRun& run);

struct Run;

/// What a run steps: a simulation, or a baseline that is none.
struct Stepper {
  const Model* model = nullptr;
  double dt = 0;                                                         ///< s
  std::function<void()> step{};                                          ///< queues one
  std::function<State()> state{};                                        ///< waits for it
  std::function<void()> measure{};                                       ///< queues a measurement of the state
  std::function<void(Run&, bool wait)> collect{};                        ///< what was measured and has arrived
  std::function<std::optional<NonFinite>(bool wait)> find_non_finite{};  ///< the first such state
  std::function<std::uint64_t()> hash{};
  std::function<int()> substeps{};  ///< of a step, the most so far
  /// Looks at a step's state for what measurements do not show.
  std::function<void(RunErrors&, long step, bool last)> inspect{};
};

struct Run {
  Stepper stepper;
  long steps = 0;  ///< to take
  RunPlan plan;
  MeasuredRun so_far{};
  bool done = false;
  std::chrono::steady_clock::time_point began{};
  long queued_steps = 0, batch = 1;  ///< of Pace::batches: taken, and how many at once
  Fence queued{};
};

/// Without metrics nothing is measured. What the run steps has to outlive it, and stay where it is.
Run begin(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan = {});
Run begin(Stepper stepper, long steps, const RunPlan& plan = {});
/// Goes on for about so many seconds; true once the run is done. It ends early when the state is not finite (its errors
/// then say so) or when interrupted() says so: ask it before making anything of the result.
bool advance(Run& run, double budget = std::numeric_limits<double>::infinity());
MeasuredRun finish(Run& run);
/// Begins, advances to the end and finishes.
MeasuredRun run_to_end(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan = {});
/// The same with a simulation of its own, every step measured; warmed up if it is for its times. `stepped` is
/// shown the start and every step.
MeasuredRun run_model(const std::shared_ptr<const Model>& model, const Settings& settings, long steps,
                      const Standard& standard = {}, bool timed = true,
                      const std::function<void(const Sim&, long)>& stepped = {});
/// Steps until a GPU that has rested runs at its full clock (an H200 idles at 345 MHz of 1980 after four
/// seconds, and takes a quarter of a second to rise), then goes back to the start. Nothing where a CPU steps.
void warm_up(Sim& sim);

}  // namespace tetpbd
