#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "app/chart.h"
#include "app/files.h"
#include "app/lab.h"
#include "app/statistics.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

const char* columns =
    "scene,mode,omega,iterations,substeps,vertices,tets,gpu_ms_per_step,wall_ms_per_step,"
    "max_volume_loss_percent,tet_volume_rms,stretch_rms,rigid_distance,reference_distance,linear_drift,"
    "angular_drift,inverted_tets,finite,pareto";
const char* table =
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
  for (const Body& body : stretched->bodies) {
    const auto first = std::ptrdiff_t(body.first_vertex), end = first + std::ptrdiff_t(body.vertices);
    const auto& rest = model->rest.positions;
    const double middle = bounds({rest.begin() + first, rest.begin() + end}).centre().y;
    for (auto v = std::size_t(first); v < std::size_t(end); ++v) {
      stretched->positions[v] = rest[v];
      stretched->positions[v].y = middle + 1.05 * (rest[v].y - middle);
    }
  }
  std::ranges::fill(stretched->velocities, glm::dvec3(0));
  stretched->obstacles.clear();
  settings.gravity = 0;
  settings.ground = false;
  const MeasuredRun run = run_model(stretched, settings, 1);
  if (!run.errors.finite || interrupted()) return std::nan("");
  return run.errors.last->rigid_distance / run.errors.first->rigid_distance;
}

ordered_json row_of(const Scene& scene, const std::shared_ptr<const Model>& model, const Settings& settings,
                    long steps) {
  const MeasuredRun run = run_model(model, settings, steps);
  ordered_json row = setting_json(scene, *model, settings);
  row["gpu_ms_per_step"] = percentiles(run.gpu_ms.values).median;
  row["wall_ms_per_step"] = percentiles(run.wall_ms.values).median;
  row["reference_distance"] = remaining_after_one_step(model, settings);
  row["pareto"] = false;
  put_errors(row, run);
  return row;
}

// Losses that agree to a thousandth are the same: two Jacobi modes differ by rounding. Times that agree to a
// fiftieth are, too: then the smaller loss counts.
void mark_front(ordered_json& rows) {
  for (auto& row : rows) {
    bool beaten = !std::isfinite(loss(row));
    for (const auto& other : rows) {
      const bool as_good = loss(other) <= 1.001 * loss(row), better = 1.001 * loss(other) < loss(row);
      beaten |=
          (cost_ms(other) < cost_ms(row) && as_good) || (cost_ms(other) <= 1.02 * cost_ms(row) && better);
    }
    row["pareto"] = !beaten;
  }
}

Chart chart_of(const ordered_json& document) {
  const auto& rows = document["rows"];
  Chart chart{"Speed against error: " + text_of(rows[0]["scene"]),
              fmt::format("{} tets, {} steps of {} s, {}; labels: iterations x substeps",
                          text_of(rows[0]["tets"]), text_of(document["steps"]), text_of(document["dt"]),
                          text_of(document["device"]["gl_renderer"])),
              "time of a step, ms (GPU time; cpu modes: wall time)",
              "largest volume loss, %",
              true,
              true};
  std::vector<ordered_json> sorted(rows.begin(), rows.end());
  std::ranges::sort(sorted, {}, cost_ms);
  Series front{"Pareto front", "#999999", {}, {}, true, false, true};
  for (const auto& row : sorted) {
    const double x = cost_ms(row), y = loss(row);
    if (!std::isfinite(y)) continue;
    if (row["pareto"] == true) {
      front.x.push_back(x), front.y.push_back(y);
      chart.notes.push_back({x, y, text_of(row["iterations"]) + " x " + text_of(row["substeps"])});
    }
    const std::string mode = text_of(row["mode"]);
    auto series = std::ranges::find(chart.series, mode, &Series::name);
    if (series == chart.series.end())
      series = chart.series.insert(series, {mode, mode_colour(mode), {}, {}, false, true, false});
    series->x.push_back(x), series->y.push_back(y);
  }
  chart.series.push_back(front);
  return chart;
}

using Quantity = double (*)(const ordered_json& row);

/// The row within a limit that is best by something else.
void print_best(const ordered_json& rows, const std::string& what, double limit, Quantity limited,
                Quantity judged) {
  std::vector<ordered_json> within;
  for (const auto& row : rows)
    if (std::isfinite(loss(row)) && limited(row) <= limit) within.push_back(row);
  if (within.empty()) return fmt::print("{}: nothing measured is\n", what);
  const auto order = [&](const auto& row) { return std::pair(judged(row), limited(row)); };
  const auto& best = *std::ranges::min_element(within, {}, order);
  fmt::print("{}: {}, {} it x {} sub, omega {} ({:.3g} ms, loss {:.3g} %)\n", what, text_of(best["mode"]),
             text_of(best["iterations"]), text_of(best["substeps"]), text_of(best["omega"]), cost_ms(best),
             loss(best));
}

}  // namespace

int run_compare(const CompareOptions& options) {
  catch_interrupts();
  make_output_folder(options.out);
  Sweep sweep{"compare", "comparison", split(columns, ','), 5, table, {}};
  sweep.facts = {{"steps", options.steps}, {"dt", 0.005}};
  std::optional<HeadlessContext> context;
  Scene scene;
  std::shared_ptr<const Model> model;
  std::vector<Settings> all;
  if (options.shards.merge.empty()) {
    scene = load_scene(options.scene, options.overrides);
    all = combinations(scene.settings, options.axes);
    model = build_model(scene);
    context.emplace(options.gpu);
    sweep.facts["dt"] = scene.settings.dt;
    sweep.facts["device"] = device_json(context->capabilities());
    sweep.combinations = all.size();
    sweep.make = [&](std::size_t i) { return std::vector{row_of(scene, model, all[i], options.steps)}; };
  }
  ordered_json document = run_sweep(sweep, options.shards);
  ordered_json& rows = document["rows"];
  mark_front(rows);
  print_device(document["device"]);
  print_table(table, rows);
  if (std::ranges::all_of(rows, [](const auto& row) { return loss(row) == 0; }))
    fmt::print("nothing has lost volume in {} steps: take more --steps, or these say nothing about error\n",
               text_of(document["steps"]));
  if (options.budget_ms)
    print_best(rows, fmt::format("best within {:g} ms a step", *options.budget_ms), *options.budget_ms,
               cost_ms, loss);
  if (options.error_percent)
    print_best(rows, fmt::format("cheapest with a loss of at most {:g} %", *options.error_percent),
               *options.error_percent, loss, cost_ms);
  write_chart(options.out / "compare", to_svg(chart_of(document)));
  write_sweep(sweep, options.out, document);
  return 0;
}

}  // namespace tetpbd
