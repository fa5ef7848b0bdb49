// `tetpbd run`: steps a scene without a window and writes frames, video and statistics.
#pragma once

#include <filesystem>
#include <string>

#include "app/scene.h"
#include "render/renderer.h"

namespace tetpbd {

struct RunOptions {
  long steps = 0;  ///< 0: the scene's duration
  std::filesystem::path out = "out";
  long png_every = 0;           ///< steps; 0: no frames
  std::filesystem::path video;  ///< empty: none
  long video_every = 0;         ///< steps a video frame; 0: real time at 30 frames a second
  long csv_every = 1;           ///< steps; 0: no stats.csv
  long measure_every = 1;       ///< steps between measurements; the last step is measured in any case
  bool positions = false;       ///< positions.npy and tets.npy
  int gpu = -1;
  int width = 1280, height = 720, samples = 4;
  ViewOptions view;
  bool progress = false;  ///< show it even if standard error is no terminal
};

/// Exit status: 0, or 1 if the state became non-finite.
int run_headless(Scene scene, const RunOptions& options);
/// Prints buffers, bytes, kernels and dispatches a step.
int print_explanation(Scene scene, int gpu);
int print_info(int gpu);

}  // namespace tetpbd
