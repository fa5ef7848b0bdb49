#include "app/hard_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/files.h"
#include "app/measure_run.h"
#include "app/progress.h"
#include "sim/error.h"
#include "sim/gl/context.h"

namespace tetpbd {

using nlohmann::ordered_json;

namespace {

const std::string reference_mode = "cpu-double";

struct HardCase {
  std::string name, mesh, mode;
  Scene scene;
};

std::vector<std::string> case_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(models_folder() / "scenes/hard", error))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

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
  bool any = false;
  for (std::size_t k = 0; k < kind_count; ++k)
    any = any || (settings.stiffness[k] > 0 && uses(settings, constraint_kinds[k]));
  return any;
}

Settings settings_of(const Scene& scene, const std::string& mode) {
  Settings settings = scene.settings;
  const std::string suffix = "-substeps";
  const std::string where = "--modes " + mode;
  std::string word = mode;
  if (word.ends_with(suffix)) {
    word.resize(word.size() - suffix.size());
    std::swap(settings.substeps, settings.iterations);
  }
  set_mode(settings, word, where);
  check_settings(settings, where);
  return settings;
}

ordered_json run_one(const HardCase& hard, long steps) {
  const Scene& scene = hard.scene;
  const auto model = build_model(scene);
  Tuning tuning;
  tuning.count_guards = true;
  Sim sim = create_sim(model, settings_of(scene, hard.mode), tuning);
  Metrics metrics = create_metrics(*model, sim.system);
  if (steps == 0) steps = std::max(1L, std::lround(scene.duration / scene.settings.dt));
  const MeasuredRun run = measure_run(sim, metrics, steps);
  const Measurement& last = *run.errors.last;
  const auto recovered = run.errors.finite ? recovered_at(run.measurements, steps) : std::nullopt;
  ordered_json row = {{"case", hard.name},
                      {"mesh", hard.mesh},
                      {"mode", hard.mode},
                      {"steps", sim.steps},
                      {"finite", run.errors.finite},
                      {"recovered_at_step", recovered ? ordered_json(*recovered) : ordered_json()},
                      {"final_volume_error_percent", json_number(last.volume_error_percent)},
                      {"inverted_tets", json_number(last.inverted_tets)},
                      {"rigid_distance", json_number(last.rigid_distance)},
                      {"reference_recovered_at_step", nullptr},
                      {"linear_drift", json_number(run.errors.linear_drift)},
                      {"angular_drift", json_number(run.errors.angular_drift)}};
  const GuardCounts guards = guard_counts(sim);
  for (std::size_t g = 0; g < GUARDS; ++g) row[fmt::format("guard_{}", guard_names[g])] = guards[g];
  return row;
}

ordered_json measured(const HardCaseOptions& options) {
  const auto known = case_names();
  if (known.empty())
    throw Error("no hard cases", (models_folder() / "scenes/hard").string(),
                "point TETPBD_MODELS at the folder models/");
  std::vector<HardCase> all;
  for (const std::string& name : options.cases.empty() ? known : options.cases)
    for (const std::string& mesh : options.meshes) {
      if (mesh != "bunny" && mesh != "block" && mesh != "tet")
        throw Error("no such mesh", "--meshes " + mesh, "choose from bunny, block, tet");
      const auto scene = scene_of(name, mesh);
      if (!scene || !is_constrained(scene->settings)) continue;  // where nothing acts, nothing recovers
      for (const std::string& mode : options.modes) {
        settings_of(*scene, mode);
        all.push_back({name, mesh, mode, *scene});
      }
    }
  HeadlessContext context(options.gpu);
  ordered_json rows = ordered_json::array();
  Progress progress("hard cases", long(all.size()) / options.shards);
  for (std::size_t i = std::size_t(options.shard - 1); i < all.size(); i += std::size_t(options.shards)) {
    rows.push_back(run_one(all[i], options.steps));
    progress.update(long(rows.size()));
  }
  return {{"device", device_json(context.capabilities())},
          {"rows_in_all", all.size()},
          {"shards", options.shards},
          {"rows", rows}};
}

ordered_json merged(const std::vector<std::filesystem::path>& folders) {
  ordered_json document;
  for (const auto& folder : folders) {
    std::ifstream stream(folder / "stability.json");
    const ordered_json part = ordered_json::parse(stream, nullptr, false);
    if (!part.is_object() || !part.contains("rows"))
      throw Error("not a finished run of hard cases", (folder / "stability.json").string(),
                  "run that shard again");
    if (document.is_null()) {
      document = part;
    } else {
      if (part["rows_in_all"] != document["rows_in_all"] || part["shards"] != document["shards"])
        throw Error("these shards differ", folder.string(), "merge runs of one command");
      for (const auto& row : part["rows"]) document["rows"].push_back(row);
    }
  }
  if (document["rows"].size() != document["rows_in_all"].get<std::size_t>())
    throw Error(
        fmt::format("{} rows of {}", document["rows"].size(), document["rows_in_all"].get<std::size_t>()),
        "--merge", "name each shard's folder once");
  return document;
}

void sort_rows(ordered_json& rows) {
  std::sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
    const auto key = [](const auto& row) {
      return std::tuple(row["case"].template get<std::string>(), row["mesh"].template get<std::string>(),
                        row["mode"].template get<std::string>());
    };
    return key(a) < key(b);
  });
}

// Every row says when the reference recovered in its case.
void add_reference(ordered_json& rows) {
  for (const auto& reference : rows)
    if (reference["mode"] == reference_mode)
      for (auto& row : rows)
        if (row["case"] == reference["case"] && row["mesh"] == reference["mesh"])
          row["reference_recovered_at_step"] = reference["recovered_at_step"];
}

}  // namespace

std::optional<long> recovered_at(const std::vector<Measurement>& measurements, long steps) {
  std::optional<long> step;
  for (auto m = measurements.rbegin(); m != measurements.rend(); ++m) {
    if (!(std::abs(m->volume_error_percent) < 1) || m->inverted_tets > 0 || !m->finite()) break;
    step = m->step;
  }
  return step && double(*step) <= 0.95 * double(steps) ? step : std::nullopt;
}

int run_hard_cases(const HardCaseOptions& options) {
  make_output_folder(options.out);
  ordered_json document = options.merge.empty() ? measured(options) : merged(options.merge);
  ordered_json& rows = document["rows"];
  if (rows.empty())
    throw Error("no hard case to run", fmt::format("--shard {}/{}", options.shard, options.shards),
                "choose cases that have the meshes asked for, and no more shards than rows");
  sort_rows(rows);
  add_reference(rows);
  fmt::print("{:<18}{:<7}{:<23}{:>7}{:>11}{:>11}{:>13}{:>10}{:>12}\n", "case", "mesh", "mode", "steps",
             "recovered", "reference", "volume err %", "inverted", "rigid dist");
  bool finite = true;
  for (const auto& row : rows) {
    finite = finite && row["finite"] == true;
    const auto value = [&](const char* key) {
      return row[key].is_number() ? fmt::format("{:.4g}", row[key].get<double>()) : std::string("never");
    };
    const auto error = [&](const char* key) {
      return row[key].is_number() ? fmt::format("{:.3g}", row[key].get<double>()) : std::string("-");
    };
    fmt::print("{:<18}{:<7}{:<23}{:>7}{:>11}{:>11}{:>13}{:>10}{:>12}{}\n", row["case"].get<std::string>(),
               row["mesh"].get<std::string>(), row["mode"].get<std::string>(), value("steps"),
               value("recovered_at_step"), value("reference_recovered_at_step"),
               error("final_volume_error_percent"), error("inverted_tets"), error("rigid_distance"),
               row["finite"] == true ? "" : "  NOT FINITE");
  }
  write_file(options.out / "stability.json", json_text(document, 1) + "\n");
  std::vector<std::string> columns;
  for (const auto& [key, value] : rows[0].items()) columns.push_back(key);
  write_file(options.out / "stability.csv", csv_text(columns, rows));
  fmt::print("{}\n", (options.out / "stability.csv").string());
  return finite ? 0 : 1;
}

}  // namespace tetpbd
