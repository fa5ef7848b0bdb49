#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "app/files.h"
#include "app/lab.h"
#include "app/statistics.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

const char* columns =
    "case,mesh,mode,steps,finite,recovered_at_step,final_volume_error_percent,inverted_tets,rigid_distance,"
    "reference_recovered_at_step,linear_drift,angular_drift";
const char* table =
    "case -18, mesh -7, mode -26, steps 7, finite 8, recovered_at_step:recovered 11, "
    "reference_recovered_at_step:reference 11, final_volume_error_percent:volume-err-% 14, "
    "inverted_tets:inverted 10, rigid_distance 16";

struct HardCase {
  std::string name, mesh, mode;
  Scene scene;
};

std::vector<std::string> case_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(models_folder() / "scenes/hard", error))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  if (names.empty())
    throw Error("no hard cases", (models_folder() / "scenes/hard").string(),
                "point TETPBD_MODELS at the folder models/");
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

std::vector<HardCase> cases_of(const CompareOptions& options) {
  std::vector<HardCase> all;
  std::vector<std::string> names = options.cases.empty() ? case_names() : options.cases;
  std::ranges::sort(names);
  for (const std::string& name : names)
    for (const std::string& mesh : options.meshes) {
      if (mesh != "bunny" && mesh != "block" && mesh != "tet")
        throw Error("no such mesh", "--meshes " + mesh, "choose from bunny, block, tet");
      const auto scene = scene_of(name, mesh);
      if (!scene || !is_constrained(scene->settings)) continue;  // where nothing acts, nothing recovers
      for (const std::string& mode : options.axes.modes) {
        settings_of(*scene, mode);
        all.push_back({name, mesh, mode, *scene});
      }
    }
  return all;
}

ordered_json row_of(const HardCase& hard, long steps) {
  const Scene& scene = hard.scene;
  const auto model = build_model(scene);
  Tuning tuning;
  tuning.count_guards = true;
  Sim sim = create_sim(model, settings_of(scene, hard.mode), tuning);
  Metrics metrics = create_metrics(*model, sim.system);
  if (steps == 0) steps = duration_in_steps(scene);
  const MeasuredRun run = run_loop(sim, &metrics, steps);
  const auto recovered = run.errors.finite ? recovered_at(run.measurements, steps) : std::nullopt;
  ordered_json row = {{"case", hard.name}, {"mesh", hard.mesh}};
  row.update(setting_json(scene, *model, sim.settings));
  row["mode"] = hard.mode;
  row["steps"] = run.steps;
  row["recovered_at_step"] = recovered ? ordered_json(*recovered) : ordered_json();
  row["reference_recovered_at_step"] = nullptr;
  put_errors(row, run);
  const GuardCounts guards = guard_counts(sim);
  for (std::size_t g = 0; g < GUARDS; ++g) row[fmt::format("guard_{}", guard_names[g])] = guards[g];
  return row;
}

// Every row says when the reference recovered in its case: Gauss-Seidel in double precision.
void add_reference(ordered_json& rows) {
  for (const auto& reference : rows)
    if (reference["mode"] == "cpu-double")
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

int run_hard_cases(const CompareOptions& options) {
  catch_interrupts();
  make_output_folder(options.out);
  Sweep sweep{"stability", "run of hard cases", split(columns, ','), 3, table, ordered_json::object()};
  for (const char* guard : guard_names) sweep.columns.push_back(fmt::format("guard_{}", guard));
  std::vector<HardCase> all;
  std::optional<HeadlessContext> context;
  if (options.shards.merge.empty()) {
    all = cases_of(options);
    context.emplace(options.gpu);
    sweep.facts["device"] = device_json(context->capabilities());
    sweep.combinations = all.size();
    sweep.make = [&](std::size_t i) { return std::vector{row_of(all[i], options.steps)}; };
  }
  ordered_json document = run_sweep(sweep, options.shards);
  ordered_json& rows = document["rows"];
  const auto name = [](const ordered_json& row) { return std::tie(row["case"], row["mesh"], row["mode"]); };
  std::sort(rows.begin(), rows.end(), [&](const auto& a, const auto& b) { return name(a) < name(b); });
  add_reference(rows);
  print_table(sweep.table, rows);
  return write_sweep(sweep, options.out, document);
}

}  // namespace tetpbd
