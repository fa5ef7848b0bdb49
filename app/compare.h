// `tetpbd compare`: speed against error over modes x iterations x substeps.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/scene.h"

namespace tetpbd {

struct CompareOptions {
  std::string scene = "bunny-drop";
  SceneOverrides overrides;
  std::vector<std::string> modes = {"node", "constraint", "cpu"};
  std::vector<int> iterations = {1, 5, 10, 25};
  std::vector<int> substeps = {1};
  std::vector<double> omegas;  ///< empty: the scene's
  long steps = 400;
  int gpu = -1;
  std::filesystem::path out = "compare";
  int shard = 1, shards = 1;  ///< this process does the combinations shard, shard + shards, ...
  std::vector<std::filesystem::path> merge;  ///< folders of finished shards, instead of running
  std::optional<double> budget_ms, error_percent;
};

/// Writes compare.csv, compare.json, compare.svg, compare.png; prints a table and what was asked for.
int run_compare(const CompareOptions& options);

}  // namespace tetpbd
