#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "app/chart.h"
#include "app/commands.h"
#include "app/files.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// ------------------------------------------------------------------------------------------------------------
// speed against error

const char* compare_columns =
    "scene,mode,omega,iterations,substeps,vertices,tets,gpu_ms_per_step,wall_ms_per_step,"
    "max_volume_loss_percent,tet_volume_rms,stretch_rms,rigid_distance,reference_distance,linear_drift,"
    "angular_drift,inverted_tets,finite,pareto";
const char* compare_table =
    "mode -18, omega 6, iterations:iter 6, substeps:sub 6, gpu_ms_per_step:GPU-ms 11, "
    "wall_ms_per_step:wall-ms 11, max_volume_loss_percent:loss-% 11, rigid_distance 16, "
    "reference_distance:one-step 11, pareto 8";

/// What a step costs: GPU time, or wall time where the CPU does the work.
double cost_ms(const ordered_json& row) {
  const double gpu = number(row, "gpu_ms_per_step");
  return gpu > 0 ? gpu : number(row, "wall_ms_per_step");
}

double loss(const ordered_json& row) {
  const double value = number(row, "max_volume_loss_percent");
  return row["finite"] == true && std::isfinite(value) ? std::max(0.0, value)
                                                       : std::numeric_limits<double>::infinity();
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
  const MeasuredRun run = run_model(stretched, settings, 1);
  if (!run.errors.finite || interrupted()) return std::nan("");
  return run.errors.last->rigid_distance / run.errors.first->rigid_distance;
}

// Losses that agree to a thousandth are the same: two Jacobi modes differ by rounding. Times that agree to a
// fiftieth are, too: then the smaller loss counts.
void mark_front(ordered_json& rows) {
  for (auto& row : rows) {
    const auto beats = [cost = cost_ms(row), lost = loss(row)](const ordered_json& other) {
      return (cost_ms(other) < cost && loss(other) <= 1.001 * lost) ||
             (cost_ms(other) <= 1.02 * cost && 1.001 * loss(other) < lost);
    };
    row["pareto"] = std::isfinite(loss(row)) && std::ranges::none_of(rows, beats);
  }
}

Chart chart_of(const ordered_json& document) {
  const auto& rows = document["rows"];
  Chart chart{"Speed against error: " + text_of(rows[0]["scene"]),
              fmt::format("{} tets, {} steps of {} s, {}; labels: iterations x substeps",
                          text_of(rows[0]["tets"]), text_of(document["steps"]), text_of(document["dt"]),
                          text_of(document["device"]["gl_renderer"])),
              "time of a step, ms (GPU time; cpu modes: wall time)", "largest volume loss, %", true};
  Series front{"Pareto front", "#999999", Series::dashes};
  for (const auto& row : rows) {
    const glm::dvec2 point(cost_ms(row), loss(row));
    if (!std::isfinite(point.y)) continue;
    if (row["pareto"] == true) {
      front.points.push_back(point);
      chart.notes.push_back({point, text_of(row["iterations"]) + " x " + text_of(row["substeps"])});
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

using Quantity = double (*)(const ordered_json& row);

/// The row within a limit, where one is asked for, that is best by something else.
void print_best(ordered_json rows, const char* what, std::optional<double> limit, Quantity limited,
                Quantity judged) {
  if (!limit) return;
  fmt::print(fmt::runtime(what), *limit);
  std::erase_if(rows.get_ref<ordered_json::array_t&>(),
                [&](const auto& row) { return !std::isfinite(loss(row)) || !(limited(row) <= *limit); });
  if (rows.empty()) return fmt::print(": nothing measured is\n");
  const auto order = [&](const auto& row) { return std::pair(judged(row), limited(row)); };
  const auto& best = *std::ranges::min_element(rows, {}, order);
  fmt::print(": {}, {} it x {} sub, omega {} ({:.3g} ms, loss {:.3g} %)\n", text_of(best["mode"]),
             text_of(best["iterations"]), text_of(best["substeps"]), text_of(best["omega"]), cost_ms(best),
             loss(best));
}

// ------------------------------------------------------------------------------------------------------------
// hard cases

const char* case_columns =
    "case,mesh,mode,steps,finite,recovered_at_step,final_volume_error_percent,inverted_tets,rigid_distance,"
    "reference_recovered_at_step,linear_drift,angular_drift";
const char* case_table =
    "case -18, mesh -7, mode -26, steps 7, finite 8, recovered_at_step:recovered 11, "
    "reference_recovered_at_step:reference 11, final_volume_error_percent:volume-err-% 14, "
    "inverted_tets:inverted 10, rigid_distance 16";

/// The case's scene with `mesh` for its body; a scene whose body is no bunny is itself the only mesh.
std::optional<Scene> scene_of(const std::string& name, const std::string& mesh) {
  Scene scene = load_scene("hard/" + name);
  BodyDescription& body = scene.bodies.at(0);
  const std::string own = body.block ? "block" : body.tet ? "tet" : "bunny";
  if (mesh == own) return scene;
  if (own != "bunny" || body.tetgen != BodyDescription{}.tetgen) return std::nullopt;  // about this very mesh
  body.mesh.clear();
  if (mesh == "block") body.block = {{0.8, 1, 0.6}, {8, 10, 6}};
  const double low = -std::sqrt(3.0) / 6, high = std::sqrt(3.0) / 3;
  if (mesh == "tet") body.tet = {{{-0.5, 0, low}, {0.5, 0, low}, {0, 0, high}, {0, std::sqrt(2.0 / 3), 0}}};
  return scene;
}

bool is_constrained(const Settings& settings) {
  for (std::size_t k = 0; k < kind_count; ++k)
    if (settings.stiffness[k] > 0 && uses(settings, constraint_kinds[k])) return true;
  return false;
}

Settings settings_of(const Scene& scene, std::string mode) {
  Settings settings = scene.settings;
  const std::string suffix = "-substeps", where = "--modes " + mode;
  if (mode.ends_with(suffix)) {
    mode.resize(mode.size() - suffix.size());
    std::swap(settings.substeps, settings.iterations);
  }
  set_mode(settings, mode, where);
  check_settings(settings, where);
  return settings;
}

ordered_json case_row(const Scene& scene, const Settings& settings, long steps) {
  const auto model = build_model(scene);
  Sim sim = create_sim(model, settings, {.count_guards = true});
  Metrics metrics = create_metrics(*model, sim.system);
  const MeasuredRun run = run_loop(sim, &metrics, steps);
  const auto recovered = run.errors.finite ? recovered_at(run.measurements, steps) : std::nullopt;
  ordered_json row = row_of(scene, *model, settings, run);
  row.update({{"steps", run.steps},
              {"recovered_at_step", recovered ? ordered_json(*recovered) : nullptr},
              {"reference_recovered_at_step", nullptr}});
  const GuardCounts guards = guard_counts(sim);
  for (std::size_t g = 0; g < GUARDS; ++g) row[fmt::format("guard_{}", guard_names[g])] = guards[g];
  return row;
}

void add_cases(Sweep& sweep, const CompareOptions& options) {
  std::vector<std::string> names = options.cases.empty() ? scene_names("scenes/hard") : options.cases;
  if (names.empty())
    throw Error("no hard cases", (models_folder() / "scenes/hard").string(),
                "point TETPBD_MODELS at the folder models/");
  std::ranges::sort(names);
  for (const std::string& name : names)
    for (const std::string& mesh : options.meshes) {
      if (mesh != "bunny" && mesh != "block" && mesh != "tet")
        throw Error("no such mesh", "--meshes " + mesh, "choose from bunny, block, tet");
      const auto scene = scene_of(name, mesh);
      if (!scene || !is_constrained(scene->settings)) continue;  // where nothing acts, nothing recovers
      for (const std::string& mode : options.axes.modes)
        sweep.work.push_back([=, settings = settings_of(*scene, mode),
                              steps = options.steps ? options.steps : duration_in_steps(*scene)] {
          ordered_json row = case_row(*scene, settings, steps);
          row.update({{"case", name}, {"mesh", mesh}, {"mode", mode}});
          return std::vector{row};
        });
    }
}

// Every row says when the reference recovered in its case: Gauss-Seidel in double precision.
void add_reference(ordered_json& rows) {
  for (const auto& reference : rows)
    if (reference["mode"] == "cpu-double")
      for (auto& row : rows)
        if (row["case"] == reference["case"] && row["mesh"] == reference["mesh"])
          row["reference_recovered_at_step"] = reference["recovered_at_step"];
}

/// Runs what `add` gives the sweep, or merges shards of it.
ordered_json run_or_merge(Sweep& sweep, const CompareOptions& options, const std::function<void()>& add) {
  make_output_folder(options.out);
  std::optional<HeadlessContext> context;
  if (options.shards.merge.empty()) {
    add();
    context.emplace(options.gpu);
    sweep.facts["device"] = device_json(context->capabilities());
  }
  return run_sweep(sweep, options.shards);
}

}  // namespace

int run_compare(const CompareOptions& options) {
  Sweep sweep{"compare", "comparison", split(compare_columns, ','), 5, compare_table, {}};
  sweep.facts = {{"steps", options.steps}, {"dt", 0.005}};
  ordered_json document = run_or_merge(sweep, options, [&] {
    const Scene scene = load_scene(options.scene, options.overrides);
    sweep.facts["dt"] = scene.settings.dt;
    const auto all = combinations(scene.settings, options.axes);
    const auto model = build_model(scene);
    for (const Settings& settings : all)
      sweep.work.push_back([=, steps = options.steps] {
        const MeasuredRun run = run_model(model, settings, steps);
        ordered_json row = row_of(scene, *model, settings, run);
        row["gpu_ms_per_step"] = median(run.gpu_ms);
        row["wall_ms_per_step"] = median(run.wall_ms);
        row["reference_distance"] = remaining_after_one_step(model, settings);
        row["pareto"] = false;
        return std::vector{row};
      });
  });
  ordered_json& rows = document["rows"];
  mark_front(rows);
  print_table(sweep, document);
  if (std::ranges::all_of(rows, [](const auto& row) { return loss(row) == 0; }))
    fmt::print("nothing has lost volume in {} steps: take more --steps, or these say nothing about error\n",
               text_of(document["steps"]));
  print_best(rows, "best within {:g} ms a step", options.budget_ms, cost_ms, loss);
  print_best(rows, "cheapest with a loss of at most {:g} %", options.error_percent, loss, cost_ms);
  write_sweep(sweep, options.out, document);
  write_chart(options.out / "compare", chart_of(document));
  return 0;
}

std::optional<long> recovered_at(const std::vector<Measurement>& measurements, long steps) {
  std::optional<long> step;
  for (auto m = measurements.rbegin(); m != measurements.rend(); ++m) {
    if (!(std::abs(m->volume_error_percent) < 1) || m->inverted_tets > 0 || !m->finite()) break;
    step = m->step;
  }
  return step && double(*step) <= 0.95 * double(steps) ? step : std::nullopt;
}

int run_hard_cases(const CompareOptions& options) {
  Sweep sweep{"stability", "run of hard cases", split(case_columns, ','), 3, case_table, {}};
  sweep.facts = ordered_json::object();
  for (const char* guard : guard_names) sweep.columns.push_back(fmt::format("guard_{}", guard));
  ordered_json document = run_or_merge(sweep, options, [&] { add_cases(sweep, options); });
  ordered_json& rows = document["rows"];
  const auto name = [](const ordered_json& row) { return std::tie(row["case"], row["mesh"], row["mode"]); };
  std::sort(rows.begin(), rows.end(), [&](const auto& a, const auto& b) { return name(a) < name(b); });
  add_reference(rows);
  print_table(sweep, document);
  return write_sweep(sweep, options.out, document);
}

}  // namespace tetpbd
