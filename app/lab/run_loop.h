// The one loop that steps a simulation for its numbers: the time of each step beside the error.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "sim/measure/metrics.h"
#include "sim/reference/total_error.h"

namespace tetpbd {

/// Of a film in real time.
inline long steps_per_frame(double dt) { return std::max(1L, std::lround(1.0 / 30 / dt)); }

/// The value that this part of them does not exceed; NaN where there are none.
double percentile(std::vector<double> values, double part);
inline double median(const std::vector<double>& values) { return percentile(values, 0.5); }

inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// On standard error, even where nothing can be written there.
void print_error(const std::string& line);
/// For count_gl_errors().
void print_gl_error(const char* text);

/// A line on standard error that is written over, on a terminal or if forced; elsewhere a new one every so
/// many seconds. `quiet`: s before the first.
struct Progress {
  std::string label;
  long total;
  bool bar;
  double every;
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now(), last;

  Progress(const std::string& of, long steps, bool force = false,
           double lines_every = std::numeric_limits<double>::infinity(), double quiet = 0);
  ~Progress();
  void update(long done);
};

/// What runs are held against, at the instants it has.
struct Standard {
  const Motion* right = nullptr;
  const TotalError* total = nullptr;
  Standard(const Motion* motion = nullptr, const TotalError* error = nullptr) : right(motion), total(error) {}
};

/// FillOptions::progress for this file: says how far its lattice is, if it takes longer than two seconds.
std::function<void(double)> fill_progress(const std::string& file);

struct RunPlan {
  long measure_every = 1;  ///< steps; the start and the last step are measured in any case
  double most_seconds = std::numeric_limits<double>::infinity();  ///< ends then, after one step at least
  bool wait = true;              ///< for each step, to time it; without: steps are queued, and timed all together
  bool check_crossings = false;  ///< ends a run where surfaces cut each other that did not at the start
  bool timed = true;             ///< GPU time of each step; its queries are GL objects that come and go
  std::function<void(long)> stepped{};  ///< after each step
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
};

/// Of a state that the run has reached: its distance from the standard there, where that has the step.
void hold_against(MeasuredRun& run, const Standard& standard, const Model& model, long step, double time,
                  const std::function<State()>& state);

/// Steps `steps` times. Ends early when the state is not finite (its errors then say so) or when
/// interrupted() says so: ask it before making anything of the result. No metrics: nothing is measured.
MeasuredRun run_loop(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan = {});
/// The same with a simulation of its own, every step measured; warmed up if it is for its times. `stepped` is
/// shown the start and every step.
MeasuredRun run_model(const std::shared_ptr<const Model>& model, const Settings& settings, long steps,
                      const Standard& standard = {}, bool timed = true,
                      const std::function<void(const Sim&, long)>& stepped = {});
/// Steps until a GPU that has rested runs at its full clock (an H200 idles at 345 MHz of 1980 after four
/// seconds, and takes a quarter of a second to rise), then goes back to the start. Nothing where a CPU steps.
void warm_up(Sim& sim);

}  // namespace tetpbd
