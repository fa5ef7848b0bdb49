// `tetpbd reproduce`: the paper's table and figures (Va, Choi, Hong 2023), measured here, in one report.
#pragma once

#include <filesystem>

namespace tetpbd {

struct ReproduceOptions {
  std::filesystem::path out = "reproduce";
  bool quick = false;  ///< bunny alone, few frames: checks the trends on a software renderer
  int gpu = -1;
};

/// Writes report.html (self-contained), figures/*.svg, tables/*.csv. Throws Error (status 1) if a trend of
/// the paper does not show.
int run_reproduce(const ReproduceOptions& options);

}  // namespace tetpbd
