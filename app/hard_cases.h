// `tetpbd compare --hard-cases`: which solver mode recovers from what, beside Gauss-Seidel in double
// precision.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/metrics.h"

namespace tetpbd {

struct HardCaseOptions {
  std::vector<std::string> cases;  ///< empty: all of models/scenes/hard
  std::vector<std::string> meshes = {"bunny", "block", "tet"};
  /// Solver modes; NAME-substeps runs mode NAME with one iteration a substep, as many substeps as the scene
  /// has iterations; node+handles as in settings.h.
  std::vector<std::string> modes = {"node", "constraint", "node-substeps", "node+handles-substeps",
                                    "cpu",  "cpu-double"};
  long steps = 0;  ///< 0: the scene's duration
  int gpu = -1;
  std::filesystem::path out = "stability";
  int shard = 1, shards = 1;
  std::vector<std::filesystem::path> merge;
};

/// The first step of those at the end that all keep the volume within 1 % and no tet inverted, if they are
/// 5 % of the run's `steps` at least: what is good for less long may be passing through.
std::optional<long> recovered_at(const std::vector<Measurement>& measurements, long steps);
/// Writes stability.csv and stability.json; prints a table. Exit status 1 if any state became non-finite.
int run_hard_cases(const HardCaseOptions& options);

}  // namespace tetpbd
