// `tetpbd soak`: a long run of a body at rest that must not drift, leak or slow down.
#pragma once

#include <filesystem>

#include "app/scene.h"

namespace tetpbd {

struct SoakOptions {
  long settle = 2000;   ///< steps before the watch begins
  long steps = 100000;  ///< steps watched
  std::filesystem::path out = "soak";
  int gpu = -1;
  bool progress = false;  ///< show it even if standard error is no terminal
};

/// Writes soak.json and soak.csv. Exit status: 0, or 1 if a check failed.
int run_soak(Scene scene, const SoakOptions& options);

}  // namespace tetpbd
