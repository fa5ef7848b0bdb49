#include "app/statistics.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "app/files.h"

namespace tetpbd {

namespace {

// What is not finite is written as null.
ordered_json vector(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

ordered_json times(const Samples& ms) {
  if (ms.values.empty()) return nullptr;
  const Percentiles p = percentiles(ms.values);
  return {{"median", p.median}, {"p05", p.p05}, {"p95", p.p95}};
}

ordered_json settings_json(const Scene& scene, const Settings& settings) {
  ordered_json result;
  for (const Parameter& row : parameters())
    with_value(settings, row, [&](const auto& value) { result[row.name] = value; });
  for (const BodyDescription& body : scene.bodies) result["bodies"].push_back(ordered_json(body_json(body)));
  result["obstacles"] = ordered_json::array();
  for (const glm::dvec4& plane : scene.obstacles) {
    const glm::dvec3 normal(plane);
    result["obstacles"].push_back({{"point", vector(normal * plane.w)}, {"normal", vector(normal)}});
  }
  result["duration"] = scene.duration;
  return result;
}

ordered_json error_json(const RunErrors& errors) {
  const Measurement last = errors.last.value_or(nothing_measured());
  return {{"max_volume_loss_percent", errors.last ? errors.max_volume_loss_percent : std::nan("")},
          {"final_volume_error_percent", last.volume_error_percent},
          {"tet_volume_rms", last.tet_volume_rms},
          {"tet_volume_max", last.tet_volume_max},
          {"inverted_tets", errors.last ? ordered_json(long(last.inverted_tets)) : ordered_json()},
          {"stretch_rms", last.stretch_rms},
          {"stretch_max", last.stretch_max},
          {"bend_rms_rad", last.bend_rms_rad},
          {"rigid_distance", last.rigid_distance}};
}

std::vector<std::pair<const char*, double>> quantities(const Measurement& now, const RunErrors& so_far) {
  const Measurement m = now.finite() ? now : nothing_measured();
  return {{"step", double(now.step)},
          {"time", now.time},
          {"volume_error_percent", m.volume_error_percent},
          {"max_volume_loss_percent", so_far.max_volume_loss_percent},
          {"tet_volume_rms", m.tet_volume_rms},
          {"tet_volume_max", m.tet_volume_max},
          {"inverted_tets", m.inverted_tets},
          {"stretch_rms", m.stretch_rms},
          {"stretch_max", m.stretch_max},
          {"bend_rms_rad", m.bend_rms_rad},
          {"rigid_distance", m.rigid_distance},
          {"linear_drift", so_far.linear_drift},
          {"angular_drift", so_far.angular_drift},
          {"kinetic_energy", m.kinetic},
          {"potential_energy", m.potential},
          {"energy", m.energy()},
          {"centre_x", m.centre.x},
          {"centre_y", m.centre.y},
          {"centre_z", m.centre.z},
          {"contacts", m.contacts},
          {"finite", now.finite()}};
}

}  // namespace

ordered_json non_finite_json(const std::optional<NonFinite>& found) {
  if (!found) return nullptr;
  return {{"step", found->step}, {"vertex", found->vertex}};
}

ordered_json setting_json(const Scene& scene, const Model& model, const Settings& settings) {
  std::string kinds = settings.constraints;
  std::ranges::replace(kinds, ',', '+');
  return {{"scene", scene.name},
          {"mode", settings.mode},
          {"omega", settings.omega},
          {"constraints", kinds},
          {"iterations", settings.iterations},
          {"substeps", settings.substeps},
          {"vertices", model.positions.size()},
          {"tets", model.rest.tets.size()}};
}

void put_finite(ordered_json& row, const MeasuredRun& run) {
  const auto& found = run.errors.non_finite;
  row["finite"] = run.errors.finite;
  row["non_finite"] = non_finite_json(found);
  if (!found) return;
  const auto text = [&](const char* key) { return text_of(row[key]); };
  const std::string where =
      fmt::format("{}, mode {}, {}, omega {}, {} iterations, {} substeps", text("scene"), text("mode"),
                  text("constraints"), text("omega"), text("iterations"), text("substeps"));
  print_error(fmt::format("tetpbd: {}\n", error_of(*found, where).what()));
}

void put_errors(ordered_json& row, const MeasuredRun& run) {
  row.update(error_json(run.errors));
  row["linear_drift"] = run.errors.linear_drift;
  row["angular_drift"] = run.errors.angular_drift;
  put_finite(row, run);
}

std::string statistics_json(const Scene& scene, const Sim& sim, const Capabilities& device,
                            const MeasuredRun& run, const GuardCounts& guards,
                            std::optional<std::uint64_t> hash, const std::optional<SolverChoice>& choice,
                            const std::optional<MotionError>& motion) {
  ordered_json j;
  j["scene"] = scene.name;
  j["settings"] = settings_json(scene, sim.settings);
  if (choice) j["solver_choice"] = solver_choice_json(*choice);
  const MeshReport mesh = report(sim.model->rest);
  j["mesh"] = {{"vertices", mesh.vertices},
               {"surface_triangles", mesh.surface_triangles},
               {"edges", mesh.edges},
               {"bends", mesh.bends},
               {"tets", mesh.tets},
               {"volume", mesh.volume},
               {"euler_characteristic", mesh.euler_characteristic}};
  j["device"] = device_json(device);
  j["timing"] = {{"steps", sim.steps},
                 {"gpu_ms_per_step", times(run.gpu_ms)},
                 {"wall_ms_per_step", times(run.wall_ms)},
                 {"fps", double(sim.steps) / run.seconds}};
  const RunErrors& errors = run.errors;
  const Measurement last = errors.last.value_or(nothing_measured());
  j["error"] = error_json(errors);
  for (const auto& [key, member] :
       {std::pair("motion_final", &MotionError::final), std::pair("motion_rms", &MotionError::rms),
        std::pair("motion_peak", &MotionError::peak), std::pair("motion_relative", &MotionError::relative)})
    j["error"][key] = motion ? *motion.*member : std::nan("");  // written as null
  j["momentum"] = {{"linear_drift", errors.linear_drift},
                   {"angular_drift", errors.angular_drift},
                   {"linear", vector(last.momentum)},
                   {"angular", vector(last.angular_momentum)}};
  j["energy"] = {{"start", errors.last ? errors.start_energy : std::nan("")},
                 {"final", last.energy()},
                 {"max", errors.last ? errors.max_energy : std::nan("")},
                 {"final_kinetic", last.kinetic},
                 {"final_potential", last.potential}};
  for (std::size_t g = 0; g < GUARDS; ++g) j["guards"][guard_names[g]] = guards[g];
  j["finite"] = errors.finite;
  j["non_finite"] = non_finite_json(errors.non_finite);
  j["state_hash"] = hash ? ordered_json(fmt::format("{:016x}", *hash)) : ordered_json();
  return json_text(j, 2) + "\n";
}

std::string csv_header() {
  std::vector<std::string> names;
  for (const auto& [name, value] : quantities({}, {})) names.emplace_back(name);
  return fmt::format("{}\n", fmt::join(names, ","));
}

std::string csv_row(const Measurement& measurement, const RunErrors& so_far) {
  std::vector<std::string> fields;  // empty where there is no number
  for (const auto& [name, value] : quantities(measurement, so_far))
    fields.push_back(std::isfinite(value) ? fmt::format("{:.9g}", value) : "");
  return fmt::format("{}\n", fmt::join(fields, ","));
}

}  // namespace tetpbd
