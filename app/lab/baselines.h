// What else would solve a scene, on one core: no solver modes, but what modes have to face.
#pragma once

#include "app/lab/run.h"

namespace tetpbd {

struct Baseline {
  const char* name;
  const char* scenes;  ///< it is for
  bool (*suits)(const Settings&);
  /// Steps, each measured and held against the standard, where there is one.
  MeasuredRun (*run)(const Model&, const Settings&, long steps, const Standard& standard);
};
const std::vector<Baseline>& baselines();

}  // namespace tetpbd
