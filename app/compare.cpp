#include "app/compare.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/chart.h"
#include "app/files.h"
#include "app/measure_run.h"
#include "app/progress.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

using nlohmann::ordered_json;

namespace {

// Columns of compare.csv in order; a row is a JSON object with these keys (null: not a number).
const std::vector<std::string> columns = {"scene",
                                          "mode",
                                          "omega",
                                          "iterations",
                                          "substeps",
                                          "vertices",
                                          "tets",
                                          "gpu_ms_per_step",
                                          "wall_ms_per_step",
                                          "max_volume_loss_percent",
                                          "tet_volume_rms",
                                          "stretch_rms",
                                          "rigid_distance",
                                          "reference_distance",
                                          "linear_drift",
                                          "angular_drift",
                                          "inverted_tets",
                                          "finite",
                                          "pareto"};

/// What a step costs: GPU time, or wall time where the CPU does the work.
double cost_ms(const ordered_json& row) {
  const auto& gpu = row["gpu_ms_per_step"];
  return gpu.is_number() ? gpu.get<double>() : row["wall_ms_per_step"].get<double>();
}
double loss(const ordered_json& row) {
  const auto& value = row["max_volume_loss_percent"];
  return value.is_number() && row["finite"] == true ? std::max(0.0, value.get<double>())
                                                    : std::numeric_limits<double>::infinity();
}

/// One step from the rest shape stretched by 5 % without gravity or ground: the exact answer is the rest
/// shape again, in place. What is left of the distance to it, as a part of what there was.
double remaining_after_one_step(const std::shared_ptr<const Model>& model, Settings settings) {
  for (double w : model->inverse_masses)
    if (!(w > 0)) return std::nan("");  // a clamped body has another answer
  auto stretched = std::make_shared<Model>(*model);
  for (const Body& body : stretched->bodies) {
    std::vector<glm::dvec3> shape(
        model->rest.positions.begin() + std::ptrdiff_t(body.first_vertex),
        model->rest.positions.begin() + std::ptrdiff_t(body.first_vertex + body.vertices));
    const double middle = bounds(shape).centre().y;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      shape[i].y = middle + 1.05 * (shape[i].y - middle);
      stretched->positions[body.first_vertex + i] = shape[i];
    }
  }
  std::fill(stretched->velocities.begin(), stretched->velocities.end(), glm::dvec3(0));
  stretched->obstacles.clear();
  settings.gravity = 0;
  settings.ground = false;
  Sim sim = create_sim(stretched, settings);
  Metrics metrics = create_metrics(*stretched, sim.system);
  const double before = measure_now(metrics, sim).rigid_distance;
  step(sim);
  if (check_finite(sim, true)) return std::nan("");
  return measure_now(metrics, sim).rigid_distance / before;
}

ordered_json run_one(const Scene& scene, const std::shared_ptr<const Model>& model, const Settings& settings,
                     long steps) {
  Sim sim = create_sim(model, settings);
  Metrics metrics = create_metrics(*model, sim.system);
  const MeasuredRun run = measure_run(sim, metrics, steps);
  if (run.errors.non_finite) {
    const std::string where =
        fmt::format("mode {}, omega {:g}, {} iterations, {} substeps", mode_word(settings), settings.omega,
                    settings.iterations, settings.substeps);
    fmt::print(stderr, "tetpbd: {}\n", error_of(*run.errors.non_finite, where).what());
  }
  const Measurement last = run.errors.last.value_or(nothing_measured());  // of the last good step
  ordered_json row;
  row["scene"] = scene.name;
  row["mode"] = mode_word(settings);
  row["omega"] = settings.omega;
  row["iterations"] = settings.iterations;
  row["substeps"] = settings.substeps;
  row["vertices"] = model->positions.size();
  row["tets"] = model->rest.tets.size();
  row["gpu_ms_per_step"] = run.timing.gpu_ms.values.empty()
                               ? ordered_json()
                               : json_number(percentiles(run.timing.gpu_ms.values).median);
  row["wall_ms_per_step"] = json_number(percentiles(run.timing.wall_ms.values).median);
  row["max_volume_loss_percent"] = json_number(run.errors.max_volume_loss_percent);
  row["tet_volume_rms"] = json_number(last.tet_volume_rms);
  row["stretch_rms"] = json_number(last.stretch_rms);
  row["bend_rms_rad"] = json_number(last.bend_rms_rad);
  row["rigid_distance"] = json_number(last.rigid_distance);
  row["reference_distance"] = json_number(remaining_after_one_step(model, settings));
  row["linear_drift"] = json_number(run.errors.linear_drift);
  row["angular_drift"] = json_number(run.errors.angular_drift);
  row["inverted_tets"] = json_number(last.inverted_tets);
  row["finite"] = run.errors.finite;
  row["non_finite"] = non_finite_json(run.errors.non_finite);
  row["pareto"] = false;
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

std::string setting_name(const ordered_json& row) {
  const std::string omega =
      row["omega"] == Settings{}.omega ? "" : fmt::format(", omega {}", row["omega"].dump());
  return fmt::format("{} {} it x {} sub{}", row["mode"].get<std::string>(), row["iterations"].get<int>(),
                     row["substeps"].get<int>(), omega);
}

Chart chart_of(const ordered_json& document) {
  Chart chart;
  const auto& rows = document["rows"];
  chart.title = fmt::format("Speed against error: {}", rows[0]["scene"].get<std::string>());
  chart.subtitle =
      fmt::format("{} tets, {} steps of {} s, {}; labels: iterations x substeps", rows[0]["tets"].get<long>(),
                  document["steps"].get<long>(), document["dt"].get<double>(),
                  document["device"]["gl_renderer"].get<std::string>());
  chart.x_label = "time of a step, ms (GPU time; cpu modes: wall time)";
  chart.y_label = "largest volume loss, %";
  chart.log_x = chart.log_y = true;
  Series front{"Pareto front", "#999999", {}, {}, true, false, true};
  std::vector<const ordered_json*> best;
  for (const auto& row : rows)
    if (row["pareto"] == true) best.push_back(&row);
  std::sort(best.begin(), best.end(), [](auto* a, auto* b) { return cost_ms(*a) < cost_ms(*b); });
  for (const auto* row : best) {
    front.x.push_back(cost_ms(*row)), front.y.push_back(loss(*row));
    chart.notes.push_back(
        {cost_ms(*row), loss(*row),
         fmt::format("{} x {}", (*row)["iterations"].get<int>(), (*row)["substeps"].get<int>())});
  }
  for (const auto& row : rows) {
    if (!std::isfinite(loss(row))) continue;
    const std::string mode = row["mode"];
    auto series = std::find_if(chart.series.begin(), chart.series.end(),
                               [&](const Series& other) { return other.name == mode; });
    if (series == chart.series.end())
      series = chart.series.insert(series, {mode, mode_colour(mode), {}, {}, false, true, false});
    series->x.push_back(cost_ms(row)), series->y.push_back(loss(row));
  }
  chart.series.push_back(front);
  return chart;
}

// Whatever stands in the file, what follows finds the keys and types it looks for.
bool is_comparison(const ordered_json& part) {
  const auto has = [](const ordered_json& object, const char* key, auto type) {
    return object.is_object() && object.contains(key) && (object.at(key).*type)();
  };
  using J = ordered_json;
  const auto is_row = [&](const ordered_json& row) {
    for (const std::string& column : columns)
      if (!row.is_object() || !row.contains(column)) return false;
    for (const char* key : {"omega", "gpu_ms_per_step", "wall_ms_per_step", "max_volume_loss_percent"})
      if (!row[key].is_number() && !row[key].is_null()) return false;
    return has(row, "scene", &J::is_string) && has(row, "mode", &J::is_string) &&
           has(row, "iterations", &J::is_number_integer) && has(row, "substeps", &J::is_number_integer) &&
           has(row, "tets", &J::is_number_integer) && has(row, "finite", &J::is_boolean) &&
           (row["gpu_ms_per_step"].is_number() || row["wall_ms_per_step"].is_number());
  };
  if (!has(part, "steps", &J::is_number_integer) || !has(part, "dt", &J::is_number) ||
      !has(part, "combinations", &J::is_number_unsigned) || !has(part, "shards", &J::is_number_integer) ||
      !has(part, "shard", &J::is_array) || !has(part, "device", &J::is_object) ||
      !has(part, "rows", &J::is_array) || !has(part["device"], "gl_renderer", &J::is_string) ||
      !has(part["device"], "software", &J::is_boolean))
    return false;
  return std::all_of(part["shard"].begin(), part["shard"].end(),
                     [](const J& s) { return s.is_number_integer(); }) &&
         std::all_of(part["rows"].begin(), part["rows"].end(), is_row);
}

ordered_json merged(const std::vector<std::filesystem::path>& folders) {
  ordered_json document;
  for (const auto& folder : folders) {
    std::ifstream stream(folder / "compare.json");
    const auto shallow = [](int depth, ordered_json::parse_event_t, ordered_json&) { return depth < 16; };
    const ordered_json part = ordered_json::parse(stream, shallow, false);
    if (!is_comparison(part))
      throw Error("not a finished comparison", (folder / "compare.json").string(), "run that shard again");
    if (document.is_null()) {
      document = part;
      continue;
    }
    // Shards of one command, or whole comparisons: other modes and other numbers of substeps.
    const bool whole = part["shards"] == 1 && document["shards"] == 1;
    for (const char* key : {"steps", "dt", "combinations", "shards"})
      if (part[key] != document[key] && !(whole && key == std::string_view("combinations")))
        throw Error("these shards differ", fmt::format("'{}' in {}", key, folder.string()),
                    "merge runs of one command");
    if (part["device"] != document["device"])
      throw Error("these shards ran on different devices", folder.string(),
                  "times can only be compared on one kind of GPU");
    for (const auto& row : part["rows"]) {
      for (const auto& other : document["rows"]) {
        if (row["scene"] != other["scene"])
          throw Error("these are of different scenes", folder.string(), "merge comparisons of one scene");
        if (setting_name(row) == setting_name(other))
          throw Error("a setting is in two of these",
                      fmt::format("{}: {}", folder.string(), setting_name(row)), "name each folder once");
      }
    }
    for (const auto& row : part["rows"]) document["rows"].push_back(row);
    if (whole)
      document["combinations"] =
          document["combinations"].get<std::size_t>() + part["combinations"].get<std::size_t>();
    else
      for (const auto& shard : part["shard"]) document["shard"].push_back(shard);
  }
  auto shards = document["shard"].get<std::vector<int>>();
  std::sort(shards.begin(), shards.end());
  if (std::adjacent_find(shards.begin(), shards.end()) != shards.end())
    throw Error("a shard was given twice", fmt::format("--merge, shards {}", fmt::join(shards, ", ")),
                "name each folder once");
  if (document["rows"].size() < document["combinations"].get<std::size_t>())
    std::fputs(fmt::format("tetpbd: only {} of {} combinations: shards {} of {}\n", document["rows"].size(),
                           document["combinations"].get<std::size_t>(), fmt::join(shards, ", "),
                           document["shards"].get<int>())
                   .c_str(),
               stderr);
  return document;
}

ordered_json measured(const CompareOptions& options) {
  Scene scene = load_scene(options.scene, options.overrides);
  std::vector<Settings> combinations;
  for (const std::string& mode : options.modes)
    for (double omega : options.omegas.empty() ? std::vector<double>{scene.settings.omega} : options.omegas)
      for (int iterations : options.iterations)
        for (int substeps : options.substeps) {
          Settings settings = scene.settings;
          set_mode(settings, mode, "--modes");
          settings.omega = omega, settings.iterations = iterations, settings.substeps = substeps;
          settings.omega = effective_omega(settings);
          if (std::find(combinations.begin(), combinations.end(), settings) == combinations.end())
            combinations.push_back(settings);  // two omegas beyond what handles allow are one
        }
  const auto model = build_model(scene);
  HeadlessContext context(options.gpu);
  const Capabilities& device = context.capabilities();
  ordered_json rows = ordered_json::array();
  Progress progress("compare", long(combinations.size()) / options.shards);
  for (std::size_t i = std::size_t(options.shard - 1); i < combinations.size();
       i += std::size_t(options.shards)) {
    try {
      rows.push_back(run_one(scene, model, combinations[i], options.steps));
    } catch (const Interrupted&) {
      break;  // the finished rows are written; merging says how many there should be
    }
    progress.update(long(rows.size()));
  }
  return {{"device", device_json(device)},
          {"steps", options.steps},
          {"dt", scene.settings.dt},
          {"combinations", combinations.size()},
          {"shard", std::vector<int>{options.shard}},
          {"shards", options.shards},
          {"rows", rows}};
}

void print_choice(const ordered_json& rows, const CompareOptions& options) {
  // The better of two by `first`, then by `second`; rows that do not qualify are left out.
  const auto best = [&](auto qualifies, auto first, auto second) -> const ordered_json* {
    const ordered_json* found = nullptr;
    for (const auto& row : rows)
      if (std::isfinite(loss(row)) && qualifies(row) &&
          (!found || std::pair(first(row), second(row)) < std::pair(first(*found), second(*found))))
        found = &row;
    return found;
  };
  if (options.budget_ms) {
    const double budget = *options.budget_ms;
    if (const auto* row = best([&](const auto& r) { return cost_ms(r) <= budget; }, loss, cost_ms))
      fmt::print("best within {:g} ms a step: {} ({:.3g} ms, loss {:.3g} %)\n", budget, setting_name(*row),
                 cost_ms(*row), loss(*row));
    else
      fmt::print("nothing measured stays within {:g} ms a step\n", budget);
  }
  if (options.error_percent) {
    const double error = *options.error_percent;
    if (const auto* row = best([&](const auto& r) { return loss(r) <= error; }, cost_ms, loss))
      fmt::print("cheapest with a loss of at most {:g} %: {} ({:.3g} ms, loss {:.3g} %)\n", error,
                 setting_name(*row), cost_ms(*row), loss(*row));
    else
      fmt::print("nothing measured loses at most {:g} %\n", error);
  }
}

}  // namespace

int run_compare(const CompareOptions& options) {
  catch_interrupts();
  make_output_folder(options.out);
  ordered_json document = options.merge.empty() ? measured(options) : merged(options.merge);
  ordered_json& rows = document["rows"];
  if (rows.empty() && interrupted())
    throw Error("interrupted", "before the first row", "nothing was written", 1);
  if (rows.empty())
    throw Error("nothing to compare", fmt::format("--shard {}/{}", options.shard, options.shards),
                "there are fewer combinations than shards");
  mark_front(rows);
  if (document["device"]["software"] == true)
    fmt::print("{}: a SOFTWARE renderer on the CPU. These are not a GPU's numbers.\n",
               document["device"]["gl_renderer"].get<std::string>());
  fmt::print("{:<14}{:>7}{:>6}{:>6}{:>12}{:>10}{:>12}{:>12}{:>12}\n", "mode", "omega", "iter", "sub",
             "ms a step", "loss %", "rigid dist", "one step", "front");
  for (const auto& row : rows) {
    const auto value = [&](const char* key) {
      return row[key].is_number() ? fmt::format("{:.4g}", row[key].get<double>()) : std::string("-");
    };
    fmt::print("{:<14}{:>7}{:>6}{:>6}{:>12.4g}{:>10}{:>12}{:>12}{:>12}\n", row["mode"].get<std::string>(),
               value("omega"), value("iterations"), value("substeps"), cost_ms(row),
               std::isfinite(loss(row)) ? fmt::format("{:.3g}", loss(row)) : "-", value("rigid_distance"),
               value("reference_distance"), row["pareto"] == true ? "*" : "");
  }
  if (std::all_of(rows.begin(), rows.end(), [](const auto& row) { return loss(row) == 0; }))
    fmt::print("nothing has lost volume in {} steps: take more --steps, or these say nothing about error\n",
               document["steps"].get<long>());
  write_file(options.out / "compare.json", json_text(document, 1) + "\n");
  write_file(options.out / "compare.csv", csv_text(columns, rows));
  write_chart(options.out / "compare", to_svg(chart_of(document)));
  print_choice(rows, options);
  fmt::print("{}\n", (options.out / "compare.csv").string());
  if (interrupted())
    throw Error(
        "interrupted",
        fmt::format("after {} of {} combinations", rows.size(), document["combinations"].get<std::size_t>()),
        "what was finished is written", 1);
  return 0;
}

}  // namespace tetpbd
