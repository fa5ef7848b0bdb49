#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "app/auto_solver.h"
#include "app/baselines.h"
#include "app/chart.h"
#include "app/commands.h"
#include "app/files.h"
#include "app/reference_command.h"
#include "app/report.h"
#include "sim/error.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// ------------------------------------------------------------------------------------------------------------
// speed against error

const char* compare_columns =
    "scene,mode,omega,iterations,substeps,vertices,tets,gpu_ms_per_step,wall_ms_per_step,"
    "max_volume_loss_percent,tet_volume_rms,stretch_rms,rigid_distance,reference_distance,linear_drift,"
    "angular_drift,inverted_tets,finite,pareto,mass_splitting,motion_final,motion_rms,motion_peak,"
    "motion_relative,tet_volume_rms_peak,stretch_rms_peak,rise,apex,energy,penetration_max,penetration_999,"
    "overlap_max,overlap_999,overlap_vertices,overlap_triangles";
const char* compare_table =
    "mode -18, omega 6, iterations:iter 6, substeps:sub 6, gpu_ms_per_step:GPU-ms 11, "
    "wall_ms_per_step:wall-ms 11, motion_final:motion 11, motion_rms:rms 11, max_volume_loss_percent:loss-% "
    "11, stretch_rms_peak:strain 11, rise 9, apex 9, energy 9, pareto 8";

/// What a step costs: GPU time, or wall time where the CPU does the work.
double cost_ms(const ordered_json& row) {
  const double gpu = number(row, "gpu_ms_per_step");
  return gpu > 0 ? gpu : number(row, "wall_ms_per_step");
}

/// By what rows are judged, in percent.
struct Judge {
  const char *name, *column, *label;
  double scale;
};
constexpr Judge judges[] = {
    {"motion", "motion_final", "distance from the right motion, % of the size", 100},
    {"volume", "max_volume_loss_percent", "largest volume loss, %", 1},
    {"strain", "stretch_rms_peak", "largest RMS strain of edges, %", 100},
    {"overlap", "overlap_max", "how deep bodies are in each other, % of the size", 100},
};
// Infinite where nothing is known.
double error_by(const Judge& judge, const ordered_json& row) {
  const double value = judge.scale * number(row, judge.column);
  return row["finite"] == true && std::isfinite(value) ? std::max(0.0, value) : std::numeric_limits<double>::infinity();
}
// The one asked for; else the motion where it is known.
const Judge& judge_of(const std::string& name, const ordered_json& rows) {
  if (!name.empty()) return *std::ranges::find(judges, name, &Judge::name);
  const bool known =
      std::ranges::any_of(rows, [](const auto& row) { return std::isfinite(number(row, "motion_final")); });
  return judges[known ? 0 : 1];
}

/// One step from the rest shape stretched by 5 % without gravity or ground: the exact answer is the rest
/// shape again, in place. What is left of the distance to it, as a part of what there was.
double remaining_after_one_step(const std::shared_ptr<const Model>& model, Settings settings) {
  if (std::ranges::count(model->inverse_masses, 0.0)) return std::nan("");  // clamped: another answer
  auto stretched = std::make_shared<Model>(*model);
  stretched->positions = model->rest.positions;
  for (glm::dvec3& p : stretched->positions) p.y *= 1.05;
  std::ranges::fill(stretched->velocities, glm::dvec3(0));
  stretched->obstacles.clear();
  settings.gravity = 0;
  settings.ground = false;
  const MeasuredRun run = run_model(stretched, settings, 1, nullptr, false);
  if (!run.errors.finite || interrupted()) return std::nan("");
  return run.errors.last->rigid_distance / run.errors.first->rigid_distance;
}

/// What sets a row apart, over the whole run: worst shapes; steepest rise of the centre of mass, m/s, and its
/// highest place after it had fallen, m; energy at the end, J.
ordered_json course_of(const MeasuredRun& run) {
  double volume = 0, strain = 0, rise = std::nan(""), apex = std::nan("");
  for (std::size_t i = 0; i < run.measurements.size(); ++i) {
    const Measurement& now = run.measurements[i];
    volume = std::max(volume, now.tet_volume_rms), strain = std::max(strain, now.stretch_rms);
    if (i == 0) continue;
    const Measurement& before = run.measurements[i - 1];
    const double speed = (now.centre.y - before.centre.y) / (now.time - before.time);
    if (speed > 0) rise = std::max(speed, std::isnan(rise) ? 0.0 : rise);
    if (!std::isnan(rise)) apex = std::max(now.centre.y, std::isnan(apex) ? now.centre.y : apex);
  }
  return {{"tet_volume_rms_peak", volume},
          {"stretch_rms_peak", strain},
          {"rise", rise},
          {"apex", apex},
          {"energy", run.measurements.empty() ? std::nan("") : run.measurements.back().energy()}};
}

ordered_json compared(const Scene& scene, const Model& model, const Settings& settings, const MeasuredRun& run) {
  ordered_json row = row_of(scene, model, settings, run);
  row.update(course_of(run));
  row["mass_splitting"] = settings.mass_splitting ? 1 : 0;
  row["gpu_ms_per_step"] = median(run.gpu_ms);
  row["wall_ms_per_step"] = median(run.wall_ms);
  row["motion_over_time"] = run.motion_over_time;
  row["reference_distance"] = nullptr;
  row["pareto"] = false;
  return row;
}

// Errors that agree to a thousandth are the same: two Jacobi modes differ by rounding. Times that agree to a
// fiftieth are, too: then the smaller error counts.
void mark_front(ordered_json& rows, const Judge& judge) {
  for (auto& row : rows) {
    const double cost = cost_ms(row), error = error_by(judge, row);
    const auto beats = [=, &judge](const ordered_json& other) {
      const double others = error_by(judge, other);
      return (cost_ms(other) < cost && others <= 1.001 * error) ||
             (cost_ms(other) <= 1.02 * cost && 1.001 * others < error);
    };
    row["pareto"] = std::isfinite(error) && std::ranges::none_of(rows, beats);
  }
}

std::string label_of(const ordered_json& row) { return text_of(row["iterations"]) + " x " + text_of(row["substeps"]); }

Chart chart_of(const ordered_json& document, const Judge& judge) {
  const auto& rows = document["rows"];
  Chart chart{
      "Speed against error: " + text_of(rows[0]["scene"]),
      fmt::format("{} tets, {} steps of {} s, {}; labels: iterations x substeps", text_of(rows[0]["tets"]),
                  text_of(document["steps"]), text_of(document["dt"]), text_of(document["device"]["gl_renderer"])),
      "time of a step, ms (GPU time; cpu modes: wall time)",
      judge.label,
      true,
      true};
  Series front{"Pareto front", "#999999", Series::dashes};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& row = rows[i];
    const glm::dvec2 point(cost_ms(row), error_by(judge, row));
    if (!std::isfinite(point.y)) continue;
    chart.spots.push_back({point, i});
    if (row["pareto"] == true) {
      front.points.push_back(point);
      chart.notes.push_back({point, label_of(row)});
    }
    const std::string mode = text_of(row["mode"]);
    auto series = std::ranges::find(chart.series, mode, &Series::name);
    if (series == chart.series.end()) series = chart.series.insert(series, {mode, mode_colour(mode)});
    series->points.push_back(point);
  }
  std::ranges::sort(front.points, {}, &glm::dvec2::x);
  chart.series.push_back(front);
  return chart;
}

/// The distance from the right motion over time: of all where they are few, else of what is on the front.
Chart course_chart(const ordered_json& document) {
  constexpr std::size_t most = 8;
  const bool all = document["rows"].size() <= most;
  Chart chart{"Error of the motion: " + text_of(document["rows"][0]["scene"]),
              all ? "mode, iterations x substeps" : "what is on the front; labels: mode, iterations x substeps",
              "time, s",
              "distance from the right motion, % of the size",
              false,
              true};
  for (const auto& row : document["rows"]) {
    if ((!all && row["pareto"] != true) || chart.series.size() == most) continue;
    Series series{text_of(row["mode"]) + ", " + label_of(row), palette_colour(chart.series.size()), Series::line};
    for (const auto& point : row["motion_over_time"])
      if (point[0] > 0) series.points.emplace_back(point[0].get<double>(), 100 * point[1].get<double>());
    if (!series.points.empty()) chart.series.push_back(series);
  }
  return chart;
}

using Quantity = std::function<double(const ordered_json& row)>;

/// The row within a limit, where one is asked for, that is best by something else.
void print_best(ordered_json rows, const char* what, std::optional<double> limit, const Judge& judge,
                const Quantity& limited, const Quantity& judged) {
  if (!limit) return;
  fmt::print(fmt::runtime(what), *limit);
  std::erase_if(rows.get_ref<ordered_json::array_t&>(),
                [&](const auto& row) { return !std::isfinite(error_by(judge, row)) || !(limited(row) <= *limit); });
  if (rows.empty()) return fmt::print(": nothing measured is\n");
  const auto order = [&](const auto& row) { return std::pair(judged(row), limited(row)); };
  const auto& best = *std::ranges::min_element(rows, {}, order);
  fmt::print(": {}, {} it x {} sub, omega {} ({:.3g} ms, {} {:.3g} %)\n", text_of(best["mode"]),
             text_of(best["iterations"]), text_of(best["substeps"]), text_of(best["omega"]), cost_ms(best), judge.name,
             error_by(judge, best));
}

}  // namespace

int run_compare(const CompareOptions& options) {
  Sweep sweep{"compare", "comparison", split(compare_columns, ','), 5, compare_table, {}};
  sweep.facts = {{"steps", options.steps}, {"dt", 0.005}};
  ordered_json document = run_or_merge(sweep, options.shards, options.out, options.gpu, [&] {
    const Scene scene = load_scene(options.scene, options.overrides);
    sweep.facts["dt"] = scene.settings.dt;
    Axes axes = options.axes;
    if (axes.modes.empty() && has_forces(scene.settings))
      axes.modes = {"node", "cpu-fast", "explicit", "newton"};
    else if (axes.modes.empty())
      axes.modes = {"node", "constraint", "cpu"};
    note_unused(scene.settings, axes.modes, options.overrides);
    const auto model = build_model(scene);
    const long steps = options.steps;
    if (options.judge == "motion") require_motion(scene, *model, steps);
    // The same for all rows: what is varied decides how the scene is solved, not how it moves.
    const auto right = std::make_shared<const std::optional<Motion>>(right_motion(*model, scene.settings));
    for (const Baseline& baseline : baselines()) {
      if (std::erase(axes.modes, baseline.name) == 0) continue;
      if (!baseline.suits(scene.settings))
        throw Error("no baseline for this scene", baseline.name, fmt::format("it is for scenes {}", baseline.scenes));
      Axes own = options.axes;
      own.modes = {}, own.omegas = {};
      for (Settings settings : combinations(scene.settings, own)) {
        settings.mode = baseline.name;
        sweep.work.push_back([=] {
          const MeasuredRun run = baseline.run(*model, settings, steps, *right ? &**right : nullptr);
          ordered_json row = compared(scene, *model, settings, run);
          for (const char* unknown : {"tet_volume_rms_peak", "stretch_rms_peak"}) row[unknown] = nullptr;
          return std::vector{row};
        });
      }
    }
    if (axes.modes.empty()) return;
    for (const Settings& settings : combinations(scene.settings, axes))
      sweep.work.push_back([=, &sweep, number = sweep.work.size(), out = options.out] {
        Film film(scene, *model, out, number, sweep.work.size());
        const MeasuredRun run = run_model(model, settings, steps, *right ? &**right : nullptr, true, film.of(steps));
        ordered_json row = compared(scene, *model, settings, run);
        row["film"] = film.write();
        row["reference_distance"] = remaining_after_one_step(model, settings);
        return std::vector{row};
      });
  });
  ordered_json& rows = document["rows"];
  const Judge& judge = judge_of(options.judge, rows);
  mark_front(rows, judge);
  print_table(sweep, document);
  fmt::print("judged by {}: {}{}\n", judge.name, judge.label,
             judge.name == std::string("motion") ? " in the chart, a part of it in the columns" : "");
  if (options.judge.empty() && std::string(judge.name) == "volume")
    fmt::print("the right motion is not known; --judge motion finds it\n");
  if (std::ranges::all_of(rows, [&](const auto& row) { return error_by(judge, row) == 0; }))
    fmt::print("no error in {} steps: take more --steps, or these say nothing\n", text_of(document["steps"]));
  const Quantity error = [&](const ordered_json& row) { return error_by(judge, row); };
  print_best(rows, "best within {:g} ms a step", options.budget_ms, judge, cost_ms, error);
  print_best(rows, "cheapest with an error of at most {:g} %", options.error_percent, judge, error, cost_ms);
  write_sweep(sweep, options.out, document);
  Chart chart = chart_of(document, judge);
  std::string figures = to_svg(chart);
  chart.spots.clear();
  write_svg(options.out / "compare", to_svg(chart));
  if (const Chart course = course_chart(document); !course.series.empty()) {
    write_svg(options.out / "motion", to_svg(course));
    figures += to_svg(course);
  }
  write_report(sweep, options.out, document, figures);
  return 0;
}

}  // namespace tetpbd
