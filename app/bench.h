// `tetpbd bench`: frames a second and milliseconds a step, by the paper's protocol, beside the error of the same setting.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/scene.h"
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
  double most_seconds = 5;     ///< a repetition stops there, with fewer frames (slow CPU modes)
  bool render = true;          ///< also with rendering
  int width = 1280, height = 720, samples = 0;
  int gpu = -1;
  std::filesystem::path out = "bench";
  SceneOverrides overrides;    ///< for every scene
};

/// Prints a table, writes bench.csv and bench.json.
int run_bench(const BenchOptions& options);

}  // namespace tetpbd
