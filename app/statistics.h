// What a run amounts to: stats.json and stats.csv, rows of sweeps; names that scripts rely on
// (docs/guide.md).
#pragma once

#include <optional>
#include <string>

#include "app/auto_solver.h"
#include "app/run_loop.h"
#include "app/scene.h"
#include "app/sweep.h"
#include "sim/reference/motion.h"

namespace tetpbd {

std::string statistics_json(const Scene& scene, const Sim& sim, const Capabilities& device,
                            const MeasuredRun& run, const GuardCounts& guards,
                            std::optional<std::uint64_t> hash, const std::optional<SolverChoice>& choice,
                            const std::optional<MotionError>& motion = std::nullopt);
std::string csv_header();
std::string csv_row(const Measurement& measurement, const RunErrors& so_far);

/// {"step", "vertex"}, or null.
ordered_json non_finite_json(const std::optional<NonFinite>& found);
/// What tells a setting of a scene apart from others: a row begins with it.
ordered_json setting_json(const Scene& scene, const Model& model, const Settings& settings);
/// Puts into the row whether the run stayed finite, and says on standard error where not.
void put_finite(ordered_json& row, const MeasuredRun& run);
/// That, the errors and the drifts.
void put_errors(ordered_json& row, const MeasuredRun& run);

}  // namespace tetpbd
