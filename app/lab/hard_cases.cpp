#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "app/commands.h"
#include "sim/error.h"
#include "sim/model/did_you_mean.h"

namespace tetpbd {

namespace {

const char* case_columns =
    "case,mesh,mode,steps,finite,recovered_at_step,final_volume_error_percent,inverted_tets,rigid_distance,"
    "reference_recovered_at_step,linear_drift,angular_drift";
const char* case_table =
    "case -18, mesh -7, mode -26, steps 7, finite 8, recovered_at_step:recovered 11, "
    "reference_recovered_at_step:reference 11, final_volume_error_percent:volume-err-% 14, "
    "inverted_tets:inverted 10, rigid_distance 16";

/// The case's scene with `mesh` for its body; a scene whose body is no bunny is itself the only mesh.
std::optional<Scene> scene_of(const std::string& name, const std::string& mesh, const SceneOverrides& overrides) {
  Scene scene = load_scene("hard/" + name, overrides);
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
  if (settings.material != "none") return true;
  for (std::size_t k = 0; k < kind_count; ++k)
    if (settings.stiffness[k] > 0 && uses(settings, constraint_kinds[k])) return true;
  return false;
}

Settings settings_of(const Scene& scene, std::string mode) {
  Settings settings = scene.settings;
  const std::string suffix = "-substeps", where = "--modes " + mode;
  if (mode.ends_with(suffix)) {
    mode.resize(mode.size() - suffix.size());
    const Plan plan = plan_for(settings);
    settings.substeps = plan.iterations, settings.iterations = plan.substeps;
  }
  if (any_material(settings, compliant)) settings.omega = std::min(settings.omega, 2.0);  // soft variants of any case
  set_mode(settings, mode, where);
  check_settings(settings, where);
  return settings;
}

ordered_json case_row(const Scene& scene, const Settings& settings, long steps) {
  const auto model = build_model(scene);
  Sim sim = create_sim(model, settings, {.count_guards = true});
  Metrics metrics = create_metrics(sim);
  const MeasuredRun run = run_to_end(sim, &metrics, steps);
  const auto recovered =
      run.errors.finite ? recovered_at(run.measurements, steps, all_materials(settings, hard)) : std::nullopt;
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
  for (std::string& name : names)
    if (name.starts_with("hard/")) name.erase(0, 5);  // as run has them
  std::ranges::sort(names);
  for (const std::string& name : names)
    for (const std::string& mesh : options.meshes) {
      if (mesh != "bunny" && mesh != "block" && mesh != "tet")
        throw Error("no such mesh", "--meshes " + mesh,
                    did_you_mean(mesh, {"bunny", "block", "tet"}) + "choose from bunny, block, tet");
      const auto scene = scene_of(name, mesh, options.overrides);
      if (!scene || !is_constrained(scene->settings)) continue;  // where nothing acts, nothing recovers
      for (const std::string& mode : find_variation(options.variations, "mode")->values)
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

}  // namespace

std::optional<long> recovered_at(const std::vector<Measurement>& measurements, long steps, bool hard) {
  std::optional<long> step;
  for (auto m = measurements.rbegin(); m != measurements.rend(); ++m) {
    if (!(std::abs(m->volume_error_percent) < 1) || m->inverted_tets > 0 || !m->finite()) break;
    if (hard && !(m->rigid_distance < 0.01)) break;
    step = m->step;
  }
  return step && double(*step) <= 0.95 * double(steps) ? step : std::nullopt;
}

int run_hard_cases(const CompareOptions& options) {
  Sweep sweep{"stability", "run of hard cases", split(case_columns, ','), {"case", "mesh", "mode"}, case_table, {}};
  sweep.facts = ordered_json::object();
  for (const char* guard : guard_names) sweep.columns.push_back(fmt::format("guard_{}", guard));
  sweep.columns.push_back("state_hash");
  ordered_json document =
      run_or_merge(sweep, options.shards, options.out, options.gpu, [&] { add_cases(sweep, options); });
  ordered_json& rows = document["rows"];
  const auto name = [](const ordered_json& row) { return std::tie(row["case"], row["mesh"], row["mode"]); };
  std::sort(rows.begin(), rows.end(), [&](const auto& a, const auto& b) { return name(a) < name(b); });
  add_reference(rows);
  print_table(sweep, document);
  return write_sweep(sweep, options.out, document);
}

}  // namespace tetpbd
