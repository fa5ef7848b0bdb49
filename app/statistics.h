// What a run amounts to: stats.json and stats.csv, rows of sweeps; names that scripts rely on
// (docs/guide.md).
#pragma once

#include <optional>
#include <string>

#include "app/run_loop.h"
#include "app/scene.h"
#include "app/sweep.h"

namespace tetpbd {

std::string csv_header();
std::string csv_row(const Measurement& measurement, const RunErrors& so_far);

ordered_json error_json(const RunErrors& errors);
/// {"step", "vertex"}, or null.
ordered_json non_finite_json(const std::optional<NonFinite>& found);
/// Puts into the row whether the run stayed finite, and says on standard error where not.
void put_finite(ordered_json& row, const MeasuredRun& run);
/// A run in a sweep: what tells its setting apart from others, errors, drifts, that.
ordered_json row_of(const Scene& scene, const Model& model, const Settings& settings, const MeasuredRun& run);

}  // namespace tetpbd
