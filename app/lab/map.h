// What `tetpbd map` and the map in the window have in common: axes of settings, and what a cell is held
// against.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/lab/run.h"
#include "app/lab/sweep.h"
#include "app/lab/vary.h"

namespace tetpbd {

/// Settings for each pair of values, row by row: `x` varies fastest. Throws Error for those that do not go together,
/// and for two variations of one setting.
std::vector<Settings> map_cells(const Settings& base, const Variation& x, const Variation& y);
/// The cache's reference motion over so many steps, or one found now; none for scenes without one. `progress` is
/// told of each step that is done.
std::optional<Motion> answer_for(const Model& model, const Settings& settings, long steps,
                                 const std::function<void(long)>& progress = {});
/// The columns of a cell that a run fills, those of map.csv.
ordered_json map_row(const MeasuredRun& run);
/// What a cell shows, in percent: the RMS distance from the reference motion where that is known, else the largest net
/// volume loss. NaN where the run failed.
double map_percent(const ordered_json& row, bool motion);

}  // namespace tetpbd
