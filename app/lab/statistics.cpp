#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "app/bodies.h"
#include "app/commands.h"
#include "app/files.h"
#include "sim/model/attachments.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

/// All that is measured, now and so far.
ordered_json quantities(const Measurement& now, const RunErrors& so_far) {
  const Measurement m = now.finite() ? now : nothing_measured();
  const auto count = [](double number) { return std::isfinite(number) ? ordered_json(long(number)) : nullptr; };
  const auto overlap = [&](auto member) -> ordered_json {
    return so_far.overlap ? ordered_json((*so_far.overlap).*member) : nullptr;
  };
  const auto crossing = [&](auto member) -> ordered_json {
    return so_far.overlap ? ordered_json(so_far.overlap->crossings.*member) : nullptr;
  };
  return {{"step", now.step},
          {"time", now.time},
          {"volume_error_percent", m.volume_error_percent},
          {"max_volume_loss_percent", so_far.max_volume_loss_percent},
          {"tet_volume_rms", m.tet_volume_rms},
          {"tet_volume_max", m.tet_volume_max},
          {"inverted_tets", count(m.inverted_tets)},
          {"stretch_rms", m.stretch_rms},
          {"stretch_max", m.stretch_max},
          {"bend_rms_rad", m.bend_rms_rad},
          {"rigid_distance", m.rigid_distance},
          {"linear_drift", so_far.linear_drift},
          {"angular_drift", so_far.angular_drift},
          {"kinetic_energy", m.kinetic},
          {"potential_energy", m.potential},
          {"energy", m.energy()},
          {"elastic_energy", m.elastic},
          {"total_energy", m.total},
          {"work", so_far.ledger.work},
          {"energy_created", so_far.ledger.created},
          {"centre_x", m.centre.x},
          {"centre_y", m.centre.y},
          {"centre_z", m.centre.z},
          {"contacts", count(m.contacts)},
          {"penetration_max", m.penetration_max},
          {"penetration_999", m.penetration_999},
          {"overlap_max", overlap(&Overlap::largest)},
          {"overlap_999", overlap(&Overlap::part_999)},
          {"overlap_vertices", overlap(&Overlap::inside)},
          {"overlap_triangles", crossing(&Crossings::pairs)},
          {"crossing_depth", crossing(&Crossings::depth)},
          {"finite", int(now.finite())}};
}

}  // namespace

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(MeshReport, vertices, surface_vertices, surface_triangles, edges, bends, tets, faces,
                                   euler_characteristic, genus, components, volume, smallest_tet_volume,
                                   mean_tet_volume, worst_altitude, worst_tet, cavities, min_dihedral_deg,
                                   max_dihedral_deg, mean_min_dihedral_deg, slivers, inverted)
std::string question_units(const glm::dvec3& size) {
  const double largest = std::max({size.x, size.y, size.z});
  if (largest >= 1e-3 && largest <= 50) return {};
  return fmt::format("{:.3g} m large: are the file's units {}? use --height or a body's key scale", largest,
                     largest > 1 ? "millimetres" : "metres");
}

double longest_stable_step(const ReferenceInput& input) {
  constexpr std::size_t most_tets = 300'000;
  const std::size_t tets = input.model.rest.tets.size();
  if (!any_material(input.settings, has_energy) || tets == 0 || tets > most_tets) return 0;
  const ConstraintList& held = input.system.lists[index_of<Attach>];
  const bool hard = std::ranges::count(held.compliance, 0.0) > 0 || (held.count() > 0 && held.compliance.empty());
  if (hard) return 0;
  return stable_step(input, input.settings.compliance, input.model.rest.positions, 30);
}

ordered_json mesh_json(const MeshReport& counts, double mass, double longest_stable_step, const Fit& fit) {
  ordered_json all = nlohmann::json(counts);
  all["size"] = {counts.size.x, counts.size.y, counts.size.z};
  all["mass"] = mass;
  if (longest_stable_step > 0) all["longest_stable_step"] = longest_stable_step;
  const glm::dvec3& at = fit.thinnest_at;
  all["thinnest_part"] = fit.thinnest;
  all["thinnest_at"] = std::isnan(fit.thinnest) ? ordered_json() : ordered_json{at.x, at.y, at.z};
  all["surface_gap"] = fit.gap, all["surface_gap_of_edge"] = fit.gap / fit.edge;
  return all;
}

ordered_json attachment_json(const Sim& sim, std::size_t number, const State& state) {
  const Attachment& a = sim.model->attachments[number];
  const double stiffness = attachment_stiffness(a, *sim.model, sim.settings);
  const bool broken = !sim.broken.empty() && sim.broken[number];
  ordered_json all = {{"body", sim.model->bodies[a.body].name},
                      {"to", sim.model->bodies[a.to].name},
                      {"vertices", a.vertices.size()},
                      {"stiffness", stiffness},
                      {"broken", broken}};
  if (stiffness > 0 && !broken) all["force"] = glm::length(attachment_force(a, stiffness, state.positions));
  return all;
}

ordered_json bodies_json(const Sim& sim, const State& state) {
  const Model& model = *sim.model;
  TetMesh now = model.rest;
  now.positions = state.positions;
  const std::vector<double> volumes = tet_volumes(now), at_rest = tet_volumes(model.rest);
  const auto three = [](const glm::dvec3& v) { return ordered_json{v.x, v.y, v.z}; };
  ordered_json all = ordered_json::array();
  for (const Body& body : model.bodies) {
    const BodySettings own{.material = solved_material(body, sim.settings),
                           .friction = friction_of(sim.settings, body.number),
                           .restitution = restitution_of(sim.settings, body.number),
                           .regions = sim.settings.bodies.empty() ? std::vector<RegionModuli>()
                                                                  : sim.settings.bodies[body.number].regions};
    glm::dvec3 centre(0), momentum(0);
    double kinetic = 0, volume = 0, rest_volume = 0, worst = 0;
    for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i) {
      const double m = model.masses[i];
      centre += m * state.positions[i], momentum += m * state.velocities[i];
      kinetic += 0.5 * m * glm::dot(state.velocities[i], state.velocities[i]);
    }
    long inverted = 0;
    for (std::size_t t = body.first_tet; t < body.first_tet + body.tets; ++t) {
      volume += volumes[t], rest_volume += at_rest[t], inverted += volumes[t] <= 0;
      worst = std::max(worst, std::abs(volumes[t] / at_rest[t] - 1));
    }
    const double mass = body_mass(model, body);
    const Bounds box = body_bounds(body, state.positions);
    ordered_json row = {{"name", body.name}, {"vertices", body.vertices}, {"tets", body.tets}, {"mass", mass}};
    row.update(body_settings_json(own));
    row.update({{"size", three(box.high - box.low)},
                {"centre", three(centre / mass)},
                {"velocity", three(momentum / mass)},
                {"kinetic_energy", kinetic},
                {"volume_error_percent", body.is_sheet() ? 0 : 100 * (volume / rest_volume - 1)},
                {"tet_volume_max", worst},
                {"inverted_tets", inverted}});
    all.push_back(std::move(row));
  }
  return all;
}

ordered_json error_json(const RunErrors& errors) {
  const ordered_json all = quantities(errors.last.value_or(nothing_measured()), errors);
  ordered_json result = {{"max_volume_loss_percent", errors.last ? errors.max_volume_loss_percent : std::nan("")},
                         {"final_volume_error_percent", all["volume_error_percent"]}};
  for (const char* key : {"tet_volume_rms", "tet_volume_max", "inverted_tets", "stretch_rms", "stretch_max",
                          "bend_rms_rad", "rigid_distance"})
    result[key] = all[key];
  // The largest of all instants; null where there is nothing to get into.
  const auto over_all = [&](double now, double largest) { return std::isnan(now) ? now : largest; };
  const Measurement last = errors.last.value_or(nothing_measured());
  result["penetration_max"] = over_all(last.penetration_max, errors.penetration_max);
  result["penetration_999"] = over_all(last.penetration_999, errors.penetration_999);
  for (const char* key : {"overlap_max", "overlap_999", "overlap_vertices", "overlap_triangles", "crossing_depth"})
    result[key] = all[key];
  return result;
}

ordered_json distance_json(const std::string& standard, const std::optional<MotionError>& error, bool finite) {
  ordered_json result;
  for (const auto& [key, member] :
       {std::pair("_final", &MotionError::final), std::pair("_rms", &MotionError::rms),
        std::pair("_peak", &MotionError::peak), std::pair("_relative", &MotionError::relative)})
    result[standard + key] = error && finite ? *error.*member : std::nan("");  // written as null
  return result;
}

ordered_json non_finite_json(const std::optional<NonFinite>& found) {
  if (!found) return nullptr;
  return {{"step", found->step}, {"vertex", found->vertex}};
}

ordered_json hash_json(const std::optional<std::uint64_t>& hash) {
  return hash ? ordered_json(fmt::format("{:016x}", *hash)) : nullptr;
}

void put_finite(ordered_json& row, const MeasuredRun& run) {
  const auto& found = run.errors.non_finite;
  row["finite"] = run.errors.finite;
  row["non_finite"] = non_finite_json(found);
  if (!found) return;
  const auto text = [&](const char* key) { return text_of(row[key]); };
  const std::string where =
      fmt::format("{}, mode {}, {}, omega {}, {} x {} (substeps x iterations)", text("scene"), text("mode"),
                  text("constraints"), text("omega"), text("substeps"), text("iterations"));
  print_error(fmt::format("tetpbd: {}\n", error_of(*found, where).what()));
}

ordered_json row_of(const Scene& scene, const Model& model, const Settings& settings, const MeasuredRun& run) {
  std::string kinds = settings.constraints;
  std::ranges::replace(kinds, ',', '+');
  ordered_json row = {{"scene", scene.name},
                      {"mode", settings.mode},
                      {"omega", settings.omega},
                      {"constraints", kinds},
                      {"iterations", plan_for(settings).iterations},
                      {"substeps", run.substeps},
                      {"vertices", model.positions.size()},
                      {"tets", model.rest.tets.size()},
                      {"linear_drift", run.errors.linear_drift},
                      {"angular_drift", run.errors.angular_drift}};
  row.update(error_json(run.errors));
  row.update(distance_json("motion", run.motion, run.errors.finite));
  put_finite(row, run);
  row["state_hash"] = hash_json(run.hash);
  return row;
}

std::string csv_header() { return fmt::format("{}\n", fmt::join(keys(quantities({}, {})), ",")); }

std::string csv_row(const Measurement& measurement, const RunErrors& so_far) {
  std::vector<std::string> fields;
  for (const auto& value : quantities(measurement, so_far)) fields.push_back(text_of(value, 9));
  return fmt::format("{}\n", fmt::join(fields, ","));
}

}  // namespace tetpbd
