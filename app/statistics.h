// stats.json and stats.csv: names that scripts rely on (docs/statistics.md).
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <random>
#include <string>
#include <vector>

#include "app/auto_solver.h"
#include "app/scene.h"
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

/// Times of the steps of a run, in milliseconds.
struct Timing {
  Samples gpu_ms, wall_ms;
  double total_s = 0;  ///< of all steps, without what came between them
};

struct Percentiles {
  double median = 0, p05 = 0, p95 = 0;
};
Percentiles percentiles(std::vector<double> values);

std::string statistics_json(const Scene& scene, const Sim& sim, const Capabilities& device,
                            const MeshReport& mesh, const Timing& timing, const RunErrors& errors,
                            const GuardCounts& guards, std::optional<std::uint64_t> hash,
                            const std::optional<SolverChoice>& choice);
/// The over-relaxation that acts: rigid handles bound it.
double effective_omega(const Settings& settings);
/// {"step", "vertex"}, or null.
nlohmann::ordered_json non_finite_json(const std::optional<NonFinite>& found);
/// null where it is no number.
nlohmann::ordered_json json_number(double value);
/// A line of column names, then one a row (objects with those keys); a field is empty where there is null.
std::string csv_text(const std::vector<std::string>& columns, const nlohmann::ordered_json& rows);
/// The device as stats.json, bench.json and compare.json name it.
nlohmann::ordered_json device_json(const Capabilities& device);
std::string csv_header();
std::string csv_row(const Measurement& measurement, const RunErrors& so_far);

}  // namespace tetpbd
