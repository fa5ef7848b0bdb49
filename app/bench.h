// `tetpbd bench`: frames a second and milliseconds a step, by the paper's protocol, beside the error of the
// same setting.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/scene.h"
#include "app/statistics.h"
#include "render/renderer.h"

namespace tetpbd {

struct BenchOptions {
  std::vector<std::string> scenes = {"bunny-drop", "armadillo-drop", "dragon-drop"};
  std::vector<std::string> modes = {"cpu", "constraint", "node"};
  std::vector<std::string> constraint_sets = {"stretch+bend", "stretch+bend+volume"};
  std::vector<int> iterations = {1, 150};
  std::vector<int> substeps = {1};
  long frames = 400, warm_up = 50;
  int repeats = 3;
  double most_seconds = 5;                ///< a repetition stops there, with fewer frames (slow CPU modes)
  std::vector<std::array<int, 2>> sizes;  ///< of rendered frames, in pixels; none: no rendering
  std::vector<std::string> pictures = {"plain", "full"};  ///< rendered at each size
  int samples = 0;
  int gpu = -1;
  std::filesystem::path out = "bench";
  SceneOverrides overrides;  ///< for every scene
};

struct BenchRow {
  std::string scene, mode, constraints, size, picture;  ///< the last two empty: no rendering
  int iterations = 1, substeps = 1;
  double omega = 1;  ///< that acts
  std::size_t vertices = 0, tets = 0, gpu_bytes = 0;
  Percentiles fps;              ///< over repetitions: median, smallest (p05), largest (p95)
  Percentiles gpu_ms, wall_ms;  ///< a step; a frame
  double draw_ms = 0;           ///< a frame whose state stands still: clearing and drawing alone
  long dispatches = 0;
  std::size_t bytes_per_step = 0;       ///< read and written by all dispatches; caches may serve part of it
  double max_volume_loss_percent = 0;   ///< NaN where the error run was cut short
  std::optional<NonFinite> non_finite;  ///< then times and loss are NaN: they say nothing
};

/// Every combination, in the current context; `report` is called after each row.
std::vector<BenchRow> bench_rows(const BenchOptions& options,
                                 const std::function<void(const BenchRow&)>& report = {});
/// Prints a table, writes bench.csv and bench.json.
int run_bench(const BenchOptions& options);
std::string bench_csv(const std::vector<BenchRow>& rows);

}  // namespace tetpbd
