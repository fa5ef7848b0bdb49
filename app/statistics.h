// stats.json and stats.csv: names that scripts rely on (docs/guide.md).
#pragma once

#include <optional>
#include <string>

#include "app/auto_solver.h"
#include "app/run_loop.h"
#include "app/scene.h"
#include "app/sweep.h"

namespace tetpbd {

std::string statistics_json(const Scene& scene, const Sim& sim, const Capabilities& device,
                            const MeasuredRun& run, const GuardCounts& guards,
                            std::optional<std::uint64_t> hash, const std::optional<SolverChoice>& choice);
/// What a run amounts to, as stats.json, compare.json and stability.json name it.
ordered_json error_json(const RunErrors& errors);
ordered_json drift_json(const RunErrors& errors);
ordered_json guards_json(const GuardCounts& guards);
/// {"step", "vertex"}, or null.
ordered_json non_finite_json(const std::optional<NonFinite>& found);
std::string csv_header();
std::string csv_row(const Measurement& measurement, const RunErrors& so_far);

}  // namespace tetpbd
