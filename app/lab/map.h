// What `tetpbd map` and the map in the window have in common: axes of settings, and what a cell is held
// against.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/model/model.h"
#include "sim/reference/motion.h"

namespace tetpbd {

struct MapAxis {
  const Parameter* row = nullptr;
  std::vector<std::string> values{};
};

/// "omega=0.5,1,1.5", or "young_modulus=1e4:1e7:7": evenly, or by equal factors where the slider goes so.
/// Throws Error naming `flag`.
MapAxis map_axis(const std::string& text, const std::string& flag);
/// The cache's reference motion over so many steps, or one found now; none for scenes without one. `progress` is
/// told of each step that is done.
std::optional<Motion> answer_for(const Model& model, const Settings& settings, long steps,
                                 const std::function<void(long)>& progress = {});

}  // namespace tetpbd
