#include "sim/loads.h"

#include <algorithm>

#include "sim/error.h"
#include "sim/parallel.h"
#include "sim/sim.h"

namespace tetpbd {

std::vector<glm::uvec4> lay_out_loads(const Model& model) {
  if (model.loads.empty()) return {};
  const std::size_t vertices = model.positions.size();
  std::vector<glm::uvec4> mesh(vertices, glm::uvec4(0));
  unsigned on_faces = 0;
  for (std::size_t k = 0; k < model.loads.size(); ++k) {
    for (const std::uint32_t v : model.loads[k].vertices) mesh[v].x |= 1u << k;
    if (model.loads[k].kind != Load::Kind::acceleration) on_faces |= 1u << k;
  }
  const auto bits_of = [&](const Triangle& t) { return mesh[t[0]].x & mesh[t[1]].x & mesh[t[2]].x & on_faces; };
  const auto& surface = model.rest.surface;
  const Grouped corners = group_by_key(surface.size(), vertices, [&](std::size_t t, auto&& emit) {
    for (std::uint32_t c = 0; c < 3 && bits_of(surface[t]); ++c) emit(surface[t][c], std::uint32_t(3 * t + c));
  });
  for (std::size_t v = 0; v < vertices; ++v) {
    mesh[v].y = std::uint32_t(vertices + corners.first[v]);
    mesh[v].z = std::uint32_t(vertices + corners.first[v + 1]);
  }
  for (const std::uint32_t corner : corners.values) {
    const Triangle& t = surface[corner / 3];
    mesh.push_back({t[(corner + 1) % 3], t[(corner + 2) % 3], bits_of(t), 0});
  }
  return mesh;
}

std::vector<layout::LoadRecord> load_records(const Model& model, double time) {
  std::vector<layout::LoadRecord> records;
  for (const Load& load : model.loads) {
    const double factor = factor_at(load.factors, time);
    const bool pressure = load.kind == Load::Kind::pressure;
    records.push_back({glm::vec3(load.vector * (pressure ? 1 : factor)),
                       load.kind == Load::Kind::acceleration ? LOAD_ACCELERATION
                       : pressure                            ? LOAD_PRESSURE
                                                             : LOAD_WIND,
                       float(load.amount * (pressure ? factor : 1)), 0, 0, 0});
  }
  return records;
}

Loads make_loads(const Model& model) {
  Loads loads;
  if (model.loads.empty()) return loads;
  const std::size_t vertices = model.positions.size();
  loads.records = Buffer("loads", 2 * model.loads.size() * sizeof(layout::LoadRecord));
  loads.mesh = Buffer("faces under load", lay_out_loads(model));
  loads.accelerations = Buffer("accelerations by loads", 2 * vertices * sizeof(glm::vec4));
  loads.accelerations.clear();
  loads.texture = make_texel_view(loads.accelerations);
  loads.pass = {Program::compute("loads.comp"), work_groups(vertices, 128), loads.mesh.bytes() + 3 * 16 * vertices};
  return loads;
}

bool load_faces(const Model& model) {
  return std::ranges::any_of(model.loads, [](const Load& l) { return l.kind != Load::Kind::acceleration; });
}

void write_loads(Sim& sim) {
  if (!sim.loads) return;
  const double time = simulated_time(sim);
  auto records = load_records(*sim.model, time_of_loads(sim.settings, time));
  const auto midway = load_records(*sim.model, time + 0.5 * sim.settings.dt);
  records.insert(records.end(), midway.begin(), midway.end());
  sim.loads.records.write(0, records.size() * sizeof records[0], records.data());
  bind_texels(UNIT_LOADS, sim.loads.texture);
}

void find_loads(Sim& sim, int substep) {
  if (!sim.loads || (substep > 0 && !load_faces(*sim.model))) return;
  Recorder& recorder = sim.recorder;
  recorder.give("LoadRecords", sim.loads.records), recorder.give("LoadMesh", sim.loads.mesh);
  recorder.give("Loads", sim.loads.accelerations);
  recorder.run(sim.loads.pass, {{"load_count", unsigned(sim.model->loads.size())},
                                {"times", solver_mode(sim.settings).implicit ? 2u : 1u}});
  recorder.barrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

std::vector<layout::HeldRecord> held_records(const ConstraintList& list, bool are_fibres) {
  std::vector<layout::HeldRecord> records;
  for (std::size_t c = 0; c < list.compliance.size(); ++c) {
    if (!(list.compliance[c] > 0)) continue;
    layout::HeldRecord& record = records.emplace_back();
    std::ranges::copy(list.ends(c), record.vertices);
    for (std::size_t k = 0; k < 5; ++k) record.rest[k] = float(list.rest[5 * c + k]);
    record.stiffness = float(1 / list.compliance[c]);
    record.is_fibre = are_fibres;
  }
  return records;
}

Activation make_activation(const ConstraintSystem& system) {
  const auto records = held_records(system.lists[index_of<Fibre>], true);
  return {Buffer("fibres", records),
          Buffer("activations before", std::vector<float>(MAX_ACTIVATIONS)),
          records.size(),
          {Program::compute("activate.comp"), 1}};
}

}  // namespace tetpbd
