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

const std::vector<std::string> columns = split(
    "scene,mode,omega,iterations,substeps,vertices,tets,gpu_ms_per_step,wall_ms_per_step,max_volume_loss_"
    "percent,"
    "tet_volume_rms,stretch_rms,rigid_distance,reference_distance,linear_drift,angular_drift,inverted_tets,"
    "finite,"
    "pareto",
    ',');
constexpr const char* table =
    "mode -18, omega 6, iterations:iter 6, substeps:sub 6, gpu_ms_per_step:GPU-ms 11, "
    "wall_ms_per_step:wall-ms 11, "
    "max_volume_loss_percent:loss-% 11, rigid_distance 16, reference_distance:one-step 11, pareto 8";

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
  for (double w : model->inverse_masses)
    if (!(w > 0)) return std::nan("");  // a clamped body has another answer
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
  std::fill(stretched->velocities.begin(), stretched->velocities.end(), glm::dvec3(0));
  stretched->obstacles.clear();
  settings.gravity = 0;
  settings.ground = false;
  Sim sim = create_sim(stretched, settings);
  Metrics metrics = create_metrics(*stretched, sim.system);
  const MeasuredRun run = run_loop(sim, &metrics, 1);
  if (!run.errors.finite || interrupted()) return std::nan("");
  return run.errors.last->rigid_distance / run.errors.first->rigid_distance;
}

ordered_json row_of(const Scene& scene, const std::shared_ptr<const Model>& model, const Settings& settings,
                    long steps) {
  Sim sim = create_sim(model, settings);
  Metrics metrics = create_metrics(*model, sim.system);
  const MeasuredRun run = run_loop(sim, &metrics, steps);
  say_non_finite(run, fmt::format("mode {}, omega {:g}, {} iterations, {} substeps", mode_word(settings),
                                  settings.omega, settings.iterations, settings.substeps));
  const auto median = [](const Samples& samples) {
    return samples.values.empty() ? std::nan("") : percentiles(samples.values).median;
  };
  ordered_json row = {{"scene", scene.name},
                      {"mode", mode_word(settings)},
                      {"omega", settings.omega},
                      {"iterations", settings.iterations},
                      {"substeps", settings.substeps},
                      {"vertices", model->positions.size()},
                      {"tets", model->rest.tets.size()},
                      {"gpu_ms_per_step", median(run.gpu_ms)},
                      {"wall_ms_per_step", median(run.wall_ms)},
                      {"reference_distance", remaining_after_one_step(model, settings)},
                      {"finite", run.errors.finite},
                      {"non_finite", non_finite_json(run.errors.non_finite)},
                      {"pareto", false}};
  row.update(error_json(run.errors));
  row.update(drift_json(run.errors));
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
  Chart chart;
  chart.title = "Speed against error: " + text_of(rows[0]["scene"]);
  chart.subtitle = fmt::format("{} tets, {} steps of {} s, {}; labels: iterations x substeps",
                               text_of(rows[0]["tets"]), text_of(document["steps"]), text_of(document["dt"]),
                               text_of(document["device"]["gl_renderer"]));
  chart.x_label = "time of a step, ms (GPU time; cpu modes: wall time)";
  chart.y_label = "largest volume loss, %";
  chart.log_x = chart.log_y = true;
  std::vector<ordered_json> sorted(rows.begin(), rows.end());
  std::sort(sorted.begin(), sorted.end(), [](auto& a, auto& b) { return cost_ms(a) < cost_ms(b); });
  Series front{"Pareto front", "#999999", {}, {}, true, false, true};
  for (const auto& row : sorted) {
    const double x = cost_ms(row), y = loss(row);
    if (!std::isfinite(y)) continue;
    if (row["pareto"] == true) {
      front.x.push_back(x), front.y.push_back(y);
      chart.notes.push_back({x, y, text_of(row["iterations"]) + " x " + text_of(row["substeps"])});
    }
    const std::string mode = text_of(row["mode"]);
    auto series = std::find_if(chart.series.begin(), chart.series.end(),
                               [&](const Series& other) { return other.name == mode; });
    if (series == chart.series.end())
      series = chart.series.insert(series, {mode, mode_colour(mode), {}, {}, false, true, false});
    series->x.push_back(x), series->y.push_back(y);
  }
  chart.series.push_back(front);
  return chart;
}

/// The row within a limit that is best by something else.
template <class Limited, class Judged>
void print_best(const ordered_json& rows, const std::string& what, double limit, const Limited& limited,
                const Judged& judged) {
  const ordered_json* best = nullptr;
  for (const auto& row : rows)
    if (std::isfinite(loss(row)) && limited(row) <= limit &&
        (!best || std::pair(judged(row), limited(row)) < std::pair(judged(*best), limited(*best))))
      best = &row;
  if (!best) return fmt::print("{}: nothing measured is\n", what);
  fmt::print("{}: {}, {} it x {} sub, omega {} ({:.3g} ms, loss {:.3g} %)\n", what, text_of((*best)["mode"]),
             text_of((*best)["iterations"]), text_of((*best)["substeps"]), text_of((*best)["omega"]),
             cost_ms(*best), loss(*best));
}

}  // namespace

int run_compare(const CompareOptions& options) {
  catch_interrupts();
  make_output_folder(options.out);
  Sweep sweep{"compare", "comparison", columns, 5, table, {{"steps", options.steps}, {"dt", 0.005}}};
  std::optional<HeadlessContext> context;
  Scene scene;
  std::shared_ptr<const Model> model;
  std::vector<Settings> all;
  if (options.merge.empty()) {
    scene = load_scene(options.scene, options.overrides);
    all = combinations(scene.settings,
                       {options.modes, {}, options.omegas, options.iterations, options.substeps});
    model = build_model(scene);
    context.emplace(options.gpu);
    sweep.facts["dt"] = scene.settings.dt;
    sweep.facts["device"] = device_json(context->capabilities());
    sweep.combinations = all.size();
    sweep.make = [&](std::size_t i) { return std::vector{row_of(scene, model, all[i], options.steps)}; };
  }
  ordered_json document = run_sweep(sweep, {options.shard, options.shards, options.merge});
  ordered_json& rows = document["rows"];
  mark_front(rows);
  print_device(document["device"]);
  print_table(table, rows);
  if (std::all_of(rows.begin(), rows.end(), [](const auto& row) { return loss(row) == 0; }))
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
