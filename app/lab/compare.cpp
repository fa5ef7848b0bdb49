#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "app/commands.h"
#include "app/files.h"
#include "app/lab/auto_solver.h"
#include "app/lab/baselines.h"
#include "app/lab/chart.h"
#include "app/lab/reference_command.h"
#include "app/lab/report.h"
#include "sim/error.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// ------------------------------------------------------------------------------------------------------------
// speed against error

const char* compare_columns =
    "scene,mode,omega,iterations,substeps,fill,element,vertices,tets,gpu_ms_per_step,wall_ms_per_step,"
    "max_volume_loss_percent,tet_volume_rms,stretch_rms,rigid_distance,reference_distance,linear_drift,"
    "angular_drift,inverted_tets,finite,pareto,mass_splitting,motion_final,motion_rms,motion_peak,"
    "motion_relative,tet_volume_rms_peak,stretch_rms_peak,rise,apex,energy,penetration_max,penetration_999,"
    "overlap_max,overlap_999,overlap_vertices,overlap_triangles,crossing_depth,total_final,total_rms,total_peak,"
    "total_relative,total_error,state_hash";
const char* compare_table =
    "mode -18, omega 6, iterations:iter 6, substeps:sub 6, gpu_ms_per_step:GPU-ms 11, "
    "wall_ms_per_step:wall-ms 11, motion_final:motion 11, motion_rms:rms 11, total_error:total 11, "
    "max_volume_loss_percent:loss-% 11, stretch_rms_peak:strain 11, rise 9, apex 9, energy 9, pareto 8";

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
    {"motion", "motion_final", "distance from the reference motion, % of the size", 100},
    {"volume", "max_volume_loss_percent", "largest volume loss, %", 1},
    {"strain", "stretch_rms_peak", "largest RMS strain of edges, %", 100},
    {"overlap", "overlap_max", "how deep bodies are in each other, % of the size", 100},
    {"total", "total_error", "total error, the solver's own added, RMS, % of the size", 100},
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

bool has_smoothed_tets(const Settings& settings) {
  return solver_mode(settings).smoothed && any_material(settings, smoothed);
}

/// What of the settings decides the motion, rather than how it is solved.
Settings without_solution(Settings settings) {
  settings.mode = has_smoothed_tets(settings) ? "newton" : SolverSettings().mode;
  settings.iterations = settings.substeps = automatic;
  settings.omega = SolverSettings().omega, settings.mass_splitting = SolverSettings().mass_splitting;
  settings.stability = SolverSettings().stability, settings.mass_scaling = SolverSettings().mass_scaling;
  settings.acceleration = SolverSettings().acceleration;
  return settings;
}
struct RightMotion {
  Settings of;  ///< without_solution()
  std::optional<Motion> motion{};
};

/// What is compared: a scene, whose bodies are filled as `fill` says, and what its runs are held against.
struct Subject {
  std::string fill;  ///< empty: as the scene says
  Scene scene;
  std::shared_ptr<const Model> model{};
  std::vector<RightMotion> right{};
  std::optional<TotalError> total{};
  Standard standard(const Settings& settings) const {
    const auto& own = std::ranges::find(right, without_solution(settings), &RightMotion::of)->motion;
    return {own ? &*own : nullptr, total ? &*total : nullptr};
  }
};

/// "tetgen:SWITCHES" or "lattice:TETS", what follows the colon left out or not, in place of the flags' own.
SceneOverrides filled_by(SceneOverrides overrides, const std::string& fill) {
  if (fill.empty()) return overrides;
  const std::size_t colon = std::min(fill.find(':'), fill.size());
  const std::string by = fill.substr(0, colon), how = fill.substr(std::min(colon + 1, fill.size()));
  const std::string where = "--fills " + fill;
  if (by != "auto" && by != "tetgen" && by != "lattice")
    throw Error("no such filling", where, "choose from auto, tetgen, tetgen:SWITCHES, lattice, lattice:TETS");
  overrides.fill = by, overrides.tets.reset(), overrides.spacing.reset();
  if (by == "lattice" && !how.empty()) overrides.tets = to_number(how, where, "write lattice:TETS");
  if (by == "tetgen" && !how.empty()) overrides.tetgen = how;
  if (overrides.tets && !(*overrides.tets >= 10 && *overrides.tets <= 1e8))
    throw Error("bad number of tets", where, "give 10 to 1e8");
  return overrides;
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

ordered_json compared(const Subject& subject, const Settings& settings, const MeasuredRun& run) {
  ordered_json row = row_of(subject.scene, *subject.model, settings, run);
  row["fill"] = subject.fill;
  row["element"] = has_smoothed_tets(settings) ? "smoothed" : "linear";
  row.update(course_of(run));
  row["mass_splitting"] = settings.mass_splitting ? 1 : 0;
  row["gpu_ms_per_step"] = median(run.gpu_ms);
  row["wall_ms_per_step"] = median(run.wall_ms);
  row.update(distance_json("total", run.total, run.errors.finite));
  // A solver that is too soft may hide a mesh that is too stiff. With its own error added the sum is at least the
  // mesh's, by the triangle inequality, and nothing gains by errors that cancel.
  row["total_error"] = number(row, "total_rms") + (run.motion ? number(row, "motion_rms") : 0);
  row["motion_over_time"] = run.motion_over_time, row["total_over_time"] = run.total_over_time;
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

// Of a row among those of one mesh.
std::string label_of(const ordered_json& row) { return text_of(row["substeps"]) + " x " + text_of(row["iterations"]); }
std::string series_of(const ordered_json& row) {
  const std::string fill = text_of(row["fill"]), by = fill.substr(0, fill.find(':'));
  return text_of(row["mode"]) + (fill.empty() ? "" : ", " + by + " " + text_of(row["tets"], 8)) +
         (row["element"] == "smoothed" ? ", smoothed" : "");
}
std::string tets_of(const ordered_json& rows) {
  const auto [least, most] = std::ranges::minmax(rows, {}, [](const auto& row) { return number(row, "tets"); });
  return text_of(least["tets"]) + (least["tets"] == most["tets"] ? "" : " to " + text_of(most["tets"]));
}

/// What of the errors of these rows is their solver's: the rest is their mesh's.
Series solver_series(const ordered_json& rows) {
  Series series{"of which the solver's", "#cc3311", Series::dashes};
  for (const auto& row : rows)
    if (row["pareto"] == true && number(row, "motion_rms") > 0)
      series.points.push_back({cost_ms(row), 100 * number(row, "motion_rms")});
  std::ranges::sort(series.points, {}, &glm::dvec2::x);
  return series;
}

Chart chart_of(const ordered_json& document, const Judge& judge) {
  const auto& rows = document["rows"];
  Chart chart{"Speed against error: " + text_of(rows[0]["scene"]),
              fmt::format("{} tets, {} steps of {} s, {}; labels: {}", tets_of(rows), text_of(document["steps"]),
                          text_of(document["dt"]), text_of(document["device"]["gl_renderer"]),
                          rows[0]["fill"] == "" ? "substeps x iterations" : "tets"),
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
      chart.notes.push_back({point, row["fill"] == "" ? label_of(row) : text_of(row["tets"], 8)});
    }
    const std::string mode = text_of(row["mode"]), name = series_of(row);
    auto series = std::ranges::find(chart.series, name, &Series::name);
    if (series == chart.series.end())
      series =
          chart.series.insert(series, {name, name == mode ? mode_colour(mode) : palette_colour(chart.series.size())});
    series->points.push_back(point);
  }
  std::ranges::sort(front.points, {}, &glm::dvec2::x);
  chart.series.push_back(front);
  if (judge.name == std::string("total"))
    if (Series solvers = solver_series(rows); !solvers.points.empty()) chart.series.push_back(solvers);
  return chart;
}

/// The distance from the standard over time: of all where they are few, else of what is on the front.
Chart course_chart(const ordered_json& document, const Judge& judge) {
  constexpr std::size_t most = 8;
  const bool all = document["rows"].size() <= most, total = judge.name == std::string("total");
  Chart chart{"Error of the motion: " + text_of(document["rows"][0]["scene"]),
              all ? "mode, substeps x iterations" : "those on the front; labels: mode, substeps x iterations",
              "time, s",
              fmt::format("distance from the {}, % of the size", total ? "motion on finer meshes" : "reference motion"),
              false,
              true};
  for (const auto& row : document["rows"]) {
    if ((!all && row["pareto"] != true) || chart.series.size() == most) continue;
    Series series{series_of(row) + ", " + label_of(row), palette_colour(chart.series.size()), Series::line};
    for (const auto& point : row[total ? "total_over_time" : "motion_over_time"])
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
  if (rows.empty()) return fmt::print(": none\n");
  const auto order = [&](const auto& row) { return std::pair(judged(row), limited(row)); };
  const auto& best = *std::ranges::min_element(rows, {}, order);
  fmt::print(": {}, {} x {} (substeps x iterations), omega {}: {:.3g} ms, {} {:.3g} %\n",
             text_of(best["mode"]) + (best["fill"] == "" ? "" : ", " + text_of(best["fill"])) +
                 (best["element"] == "smoothed" ? ", smoothed" : ""),
             text_of(best["substeps"]), text_of(best["iterations"]), text_of(best["omega"]), cost_ms(best), judge.name,
             error_by(judge, best));
}

/// What varies, with the modes that suit the scene where none are named.
std::vector<Variation> variations_for(const CompareOptions& options, const Settings& own) {
  std::vector<Variation> all = options.variations;
  if (!find_variation(all, "mode"))
    vary(all, parse_variation(has_forces(own) ? "mode=node,cpu-fast,explicit,newton" : "mode=node,constraint,cpu",
                              "--modes"));
  return all;
}

/// A setting to run, by a mode or by a baseline.
struct Candidate {
  Settings settings;
  const Baseline* baseline = nullptr;
};

/// Baselines first. Throws Error for those that do not suit the scene.
std::vector<Candidate> candidates_for(const CompareOptions& options, const Settings& own) {
  std::vector<Variation> all = variations_for(options, own), plain = all;
  std::erase_if(plain, [](const Variation& v) { return v.row->name == "mode" || v.row->name == "omega"; });
  Variation modes = *find_variation(all, "mode");
  std::vector<Candidate> candidates;
  for (const Baseline& baseline : baselines()) {
    if (std::erase(modes.values, baseline.name) == 0) continue;
    if (!baseline.suits(own))
      throw Error("no baseline for this scene", baseline.name, fmt::format("it is for scenes {}", baseline.scenes));
    for (Settings settings : without_repeats(combine(own, plain))) {
      settings.mode = baseline.name;
      candidates.push_back({settings, &baseline});
    }
  }
  vary(all, modes);
  for (const Settings& settings : without_repeats(combine(own, all))) candidates.push_back({settings});
  return candidates;
}

/// The reference motion of each setting that has one of its own.
void find_right_motions(Subject& subject, const CompareOptions& options, const std::vector<Candidate>& candidates) {
  for (const Candidate& candidate : candidates) {
    const Settings deciding = without_solution(candidate.settings);
    if (std::ranges::find(subject.right, deciding, &RightMotion::of) != subject.right.end()) continue;
    Scene scene = subject.scene;
    scene.settings = candidate.settings;
    if (options.judge == "motion" || options.judge == "total") require_motion(scene, *subject.model, options.steps);
    subject.right.push_back({deciding, right_motion(*subject.model, scene.settings)});
  }
}

ordered_json run_candidate(const Subject& subject, const Candidate& candidate, const CompareOptions& options,
                           std::size_t number, std::size_t rows) {
  const Settings& settings = candidate.settings;
  const Standard standard = subject.standard(settings);
  if (candidate.baseline) {
    const MeasuredRun run = candidate.baseline->run(*subject.model, settings, options.steps, standard);
    ordered_json row = compared(subject, settings, run);
    for (const char* unknown : {"tet_volume_rms_peak", "stretch_rms_peak"}) row[unknown] = nullptr;
    return row;
  }
  Film film(subject.scene, *subject.model, options.out, number, rows);
  const MeasuredRun run = run_model(subject.model, settings, options.steps, standard, true, film.of(options.steps));
  ordered_json row = compared(subject, settings, run);
  row["film"] = film.write();
  row["reference_distance"] = remaining_after_one_step(subject.model, settings);
  return row;
}

/// A run for each candidate of a subject.
void add_runs(Sweep& sweep, const CompareOptions& options, const std::string& fill,
              std::shared_ptr<const Truth>& truth) {
  auto subject =
      std::make_shared<Subject>(Subject{fill, load_scene(options.scene, filled_by(options.overrides, fill))});
  const Settings& own = subject->scene.settings;
  subject->model = build_model(subject->scene);
  sweep.facts["dt"] = own.dt;
  if (sweep.work.empty())  // the same for all fills
    note_unused(own, find_variation(variations_for(options, own), "mode")->values, options.overrides);
  const std::vector<Candidate> candidates = candidates_for(options, own);
  find_right_motions(*subject, options, candidates);
  if (options.judge == "total") {
    if (!truth) truth = require_truth(subject->scene, options.steps, options.truth);
    subject->total = total_error(truth, *subject->model);
  }
  for (const Candidate& candidate : candidates)
    sweep.work.push_back([=, &sweep, &options, number = sweep.work.size()] {
      return std::vector{run_candidate(*subject, candidate, options, number, sweep.work.size())};
    });
}

}  // namespace

int run_compare(const CompareOptions& options) {
  Sweep sweep{"compare",
              "comparison",
              split(compare_columns, ','),
              {"scene", "mode", "omega", "iterations", "substeps", "fill", "element", "constraints", "mass_splitting"},
              compare_table,
              {}};
  for (const char* column : {"element", "constraints"})
    if (const Variation* varied = find_variation(options.variations, column); varied && varied->values.size() > 1)
      sweep.table.insert(0, fmt::format("{} -{}, ", column, varied->row->name == "element" ? 10 : 22));
  if (!options.fills.empty())
    sweep.table.insert(0,
                       fmt::format("fill -{}, ", 2 + std::ranges::max(options.fills, {}, &std::string::size).size()));
  sweep.facts = {{"steps", options.steps}, {"dt", 0.005}};
  ordered_json document = run_or_merge(sweep, options.shards, options.out, options.gpu, [&] {
    std::vector<std::string> fills = options.fills;
    if (fills.empty()) fills = {""};
    std::shared_ptr<const Truth> truth;  // the same for all fills
    for (const std::string& fill : fills) add_runs(sweep, options, fill, truth);
  });
  ordered_json& rows = document["rows"];
  const Judge& judge = judge_of(options.judge, rows);
  mark_front(rows, judge);
  print_table(sweep, document);
  fmt::print("judged by {}: {}{}\n", judge.name, judge.label,
             judge.scale == 100 ? " in the chart, a part of it in the columns" : "");
  if (options.judge.empty() && std::string(judge.name) == "volume")
    fmt::print("the reference motion is not known; --judge motion finds it\n");
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
  if (const Chart course = course_chart(document, judge); !course.series.empty()) {
    write_svg(options.out / "motion", to_svg(course));
    figures += to_svg(course);
  }
  write_report(sweep, options.out, document, figures);
  return 0;
}

}  // namespace tetpbd
