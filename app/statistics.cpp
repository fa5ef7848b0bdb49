#include "app/statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "app/files.h"
#include "sim/solvers/clusters.h"

namespace tetpbd {

using nlohmann::ordered_json;

void Samples::add(double value) {
  ++count;
  if (values.size() < most) {
    values.push_back(value);
  } else if (const std::uint64_t place = random() % count; place < most) {
    values[place] = value;
  }
}

Percentiles percentiles(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    return values[std::size_t(std::lround(part * double(values.size() - 1)))];
  };
  return {at(0.5), at(0.05), at(0.95)};
}

namespace {

// Nothing non-finite is written as a number.
ordered_json vector(const glm::dvec3& v) { return {json_number(v.x), json_number(v.y), json_number(v.z)}; }

ordered_json times(const Samples& ms) {
  if (ms.values.empty()) return nullptr;
  const Percentiles p = percentiles(ms.values);
  return {{"median", json_number(p.median)}, {"p05", json_number(p.p05)}, {"p95", json_number(p.p95)}};
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

}  // namespace

double effective_omega(const Settings& settings) {
  return relaxation(settings.omega, settings.handles);
}

ordered_json json_number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

std::string csv_text(const std::vector<std::string>& columns, const ordered_json& rows) {
  std::string csv;
  for (const std::string& column : columns) csv += (csv.empty() ? "" : ",") + column;
  csv += "\n";
  for (const auto& row : rows) {
    std::string line;
    for (const std::string& column : columns) {
      if (&column != &columns.front()) line += ",";
      const auto& value = row[column];
      line += value.is_string() ? csv_field(value.get<std::string>()) : value.is_null() ? "" : value.dump();
    }
    csv += line + "\n";
  }
  return csv;
}

ordered_json device_json(const Capabilities& device) {
  return {{"gl_renderer", device.renderer},
          {"gl_vendor", device.vendor},
          {"gl_version", device.version},
          {"software", device.software}};
}

ordered_json non_finite_json(const std::optional<NonFinite>& found) {
  if (!found) return nullptr;
  return {{"step", found->step}, {"vertex", found->vertex}};
}

std::string statistics_json(const Scene& scene, const Sim& sim, const Capabilities& device,
                            const MeshReport& mesh, const Timing& timing, const RunErrors& errors,
                            const GuardCounts& guards, std::optional<std::uint64_t> hash,
                            const std::optional<SolverChoice>& choice) {
  ordered_json j;
  j["scene"] = scene.name;
  j["settings"] = settings_json(scene, sim.settings);
  if (choice) j["solver_choice"] = solver_choice_json(*choice);
  j["solver"] = {{"omega", effective_omega(sim.settings)}};
  j["mesh"] = {{"vertices", mesh.vertices},
               {"surface_triangles", mesh.surface_triangles},
               {"edges", mesh.edges},
               {"bends", mesh.bends},
               {"tets", mesh.tets},
               {"volume", mesh.volume},
               {"euler_characteristic", mesh.euler_characteristic}};
  j["device"] = device_json(device);
  j["timing"] = {
      {"steps", sim.steps},
      {"gpu_ms_per_step", times(timing.gpu_ms)},
      {"wall_ms_per_step", times(timing.wall_ms)},
      {"fps", timing.total_s > 0 ? json_number(double(sim.steps) / timing.total_s) : ordered_json(nullptr)}};
  const Measurement last = errors.last.value_or(nothing_measured());
  const auto measured = [&](double value) {
    return errors.last ? json_number(value) : ordered_json(nullptr);
  };
  j["error"] = {{"max_volume_loss_percent", measured(errors.max_volume_loss_percent)},
                {"final_volume_error_percent", json_number(last.volume_error_percent)},
                {"tet_volume_rms", json_number(last.tet_volume_rms)},
                {"tet_volume_max", json_number(last.tet_volume_max)},
                {"inverted_tets", std::isfinite(last.inverted_tets) ? ordered_json(long(last.inverted_tets))
                                                                    : ordered_json(nullptr)},
                {"stretch_rms", json_number(last.stretch_rms)},
                {"stretch_max", json_number(last.stretch_max)},
                {"bend_rms_rad", json_number(last.bend_rms_rad)},
                {"rigid_distance", json_number(last.rigid_distance)}};
  j["momentum"] = {{"linear_drift", json_number(errors.linear_drift)},
                   {"angular_drift", json_number(errors.angular_drift)},
                   {"linear", vector(last.momentum)},
                   {"angular", vector(last.angular_momentum)}};
  j["energy"] = {{"start", measured(errors.start_energy)},
                 {"final", json_number(last.energy())},
                 {"max", measured(errors.max_energy)},
                 {"final_kinetic", json_number(last.kinetic)},
                 {"final_potential", json_number(last.potential)}};
  for (std::size_t g = 0; g < GUARDS; ++g) j["guards"][guard_names[g]] = guards[g];
  j["finite"] = errors.finite;
  j["non_finite"] = non_finite_json(errors.non_finite);
  j["state_hash"] = hash ? ordered_json(fmt::format("{:016x}", *hash)) : ordered_json(nullptr);
  return json_text(j, 2) + "\n";
}

namespace {

struct Column {
  const char* name;
  double (*value)(const Measurement&, const RunErrors&);
  bool always = false;  ///< also says something about a state that is not finite
};

const std::vector<Column>& columns() {
  using M = Measurement;
  using E = RunErrors;
  static const std::vector<Column> rows = {
      {"step", [](const M& m, const E&) { return double(m.step); }, true},
      {"time", [](const M& m, const E&) { return m.time; }, true},
      {"volume_error_percent", [](const M& m, const E&) { return m.volume_error_percent; }},
      {"max_volume_loss_percent", [](const M&, const E& e) { return e.max_volume_loss_percent; }, true},
      {"tet_volume_rms", [](const M& m, const E&) { return m.tet_volume_rms; }},
      {"tet_volume_max", [](const M& m, const E&) { return m.tet_volume_max; }},
      {"inverted_tets", [](const M& m, const E&) { return m.inverted_tets; }},
      {"stretch_rms", [](const M& m, const E&) { return m.stretch_rms; }},
      {"stretch_max", [](const M& m, const E&) { return m.stretch_max; }},
      {"bend_rms_rad", [](const M& m, const E&) { return m.bend_rms_rad; }},
      {"rigid_distance", [](const M& m, const E&) { return m.rigid_distance; }},
      {"linear_drift", [](const M&, const E& e) { return e.linear_drift; }, true},
      {"angular_drift", [](const M&, const E& e) { return e.angular_drift; }, true},
      {"kinetic_energy", [](const M& m, const E&) { return m.kinetic; }},
      {"potential_energy", [](const M& m, const E&) { return m.potential; }},
      {"energy", [](const M& m, const E&) { return m.energy(); }},
      {"centre_x", [](const M& m, const E&) { return m.centre.x; }},
      {"centre_y", [](const M& m, const E&) { return m.centre.y; }},
      {"centre_z", [](const M& m, const E&) { return m.centre.z; }},
      {"contacts", [](const M& m, const E&) { return m.contacts; }},
      {"finite", [](const M& m, const E&) { return m.finite() ? 1.0 : 0.0; }, true},
  };
  return rows;
}

}  // namespace

std::string csv_header() {
  std::string text;
  for (const Column& column : columns()) text += (text.empty() ? "" : ",") + std::string(column.name);
  return text + "\n";
}

std::string csv_row(const Measurement& measurement, const RunErrors& so_far) {
  std::string text;
  for (const Column& column : columns()) {
    if (!text.empty()) text += ',';
    const double value = column.value(measurement, so_far);
    if (std::isfinite(value) && (column.always || measurement.finite()))
      text += fmt::format("{:.9g}", value);  // an empty field where it is no number
  }
  return text + "\n";
}

}  // namespace tetpbd
