// The one loop that steps a simulation for its numbers: the time of each step beside the error.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "sim/metrics.h"

namespace tetpbd {

/// Numbers in bounded memory: all of them up to `most`, then a random choice of `most` among all so far
/// (reservoir sampling, always the same seed). Percentiles are exact up to there and estimates beyond.
struct Samples {
  static constexpr std::size_t most = 1 << 16;
  std::vector<double> values;
  std::uint64_t count = 0;  ///< added
  std::mt19937_64 random;
  void add(double value);
};

struct Percentiles {
  double median, p05, p95;
};
/// NaN where there are none.
Percentiles percentiles(std::vector<double> values);

inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// On standard error, even where nothing can be written there.
void print_error(const std::string& line);

/// A line on standard error, on a terminal only unless forced.
class Progress {
 public:
  Progress(std::string label, long total, bool force = false);
  ~Progress();
  void update(long done);

 private:
  std::string label_;
  long total_;
  bool shown_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(), last_{};
};

struct RunPlan {
  long measure_every = 1;  ///< steps; the start and the last step are measured in any case
  double most_seconds = std::numeric_limits<double>::infinity();  ///< ends then, after one step at least
  bool wait = true;   ///< for each step, to time it; without: steps are queued, and timed all together
  bool timed = true;  ///< GPU time of each step; its queries are GL objects that come and go
  Progress* progress = nullptr;
  std::function<void(long)> stepped{};  ///< after each step
  /// Takes each measurement as it arrives; without, the run keeps them.
  std::function<void(const Measurement&, const RunErrors&)> measured{};
};

struct MeasuredRun {
  RunErrors errors;
  std::vector<Measurement> measurements;  ///< the start first
  Samples gpu_ms, wall_ms;                ///< a step; GPU time is that of its passes alone
  double seconds = 0;                     ///< of all steps, without what came between those waited for
  long steps = 0;                         ///< taken, and finite
};

/// Steps `steps` times. Ends early when the state is not finite (its errors then say so) or when
/// interrupted() says so: ask it before making anything of the result. No metrics: nothing is measured.
MeasuredRun run_loop(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan = {});
/// The same with a simulation of its own, every step measured.
MeasuredRun run_model(const std::shared_ptr<const Model>& model, const Settings& settings, long steps);
/// Steps until a GPU that has rested while the CPU prepared the scene runs at its full clock, which takes a
/// few hundred milliseconds. Nothing on a software renderer.
void warm_up(Sim& sim);

}  // namespace tetpbd
