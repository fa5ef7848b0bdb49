// Pinned vertices on their way to where a caller wants them: over a step, with the velocity that takes, so that they
// touch others as anything else that moves does.
#include <map>

#include "sim/sim.h"

namespace tetpbd {

namespace {

// What a dispatch does (shaders/lead.comp).
enum Stage : unsigned { aims, goes, stops };

void run(Sim& sim, Stage stage, int substep) {
  Led& led = sim.led;
  sim.recorder.give("LedVertices", led.records);
  if (sim.solver.quantized_buffers > 0) sim.recorder.give("QuantizedOut", sim.quantized[sim.read_index]);
  sim.recorder.use(led.pass.program).set("part", 1 / float(sim.plan.substeps - substep));
  sim.recorder.run(led.pass, {{"stage", stage},
                              {"phases", sim.pairs.phases},
                              {"count", unsigned(led.vertices.size())},
                              {"starts", substep == 0}});
  give_quantized(sim);
}

void write_records(Led& led) {
  std::vector<layout::LedVertex> records(led.vertices.size());
  for (std::size_t k = 0; k < records.size(); ++k) {
    split_double_single(led.places[k], records[k].high, records[k].low);
    records[k].vertex = led.vertices[k];
  }
  const std::size_t bytes = records.size() * sizeof records[0];
  if (led.records.bytes() < bytes)
    led.records = Buffer("led vertices", records);
  else
    led.records.write(0, bytes, records.data());
  led.pass.work_groups = work_groups(records.size(), 64);
}

}  // namespace

void move_pinned(Sim& sim, const VertexList& vertices, const std::vector<glm::dvec3>& places) {
  Led& led = sim.led;
  led.vertices.insert(led.vertices.end(), vertices.begin(), vertices.end());
  led.places.insert(led.places.end(), places.begin(), places.end());
}

void begin_leading(Sim& sim) {
  Led& led = sim.led;
  led.by_hand = !led.vertices.empty();
  std::map<std::uint32_t, glm::dvec3> last;
  for (const Fixture& fixture : sim.model->fixtures)
    for (const std::uint32_t v : fixture.vertices)
      if (is_pinned(sim, v))
        last[v] = moved_along(fixture.path, sim.model->positions[v], simulated_time(sim) + sim.settings.dt);
  for (std::size_t k = 0; k < led.vertices.size(); ++k)
    if (is_pinned(sim, led.vertices[k])) last[led.vertices[k]] = led.places[k];  // others were let go of since
  led.vertices.clear(), led.places.clear();
  for (const auto& [vertex, place] : last) led.vertices.push_back(vertex), led.places.push_back(place);
  if (led.vertices.empty()) return;
  if (on_cpu(sim)) {
    for (std::size_t k = 0; k < led.vertices.size(); ++k)
      sim.host.velocities[led.vertices[k]] = (led.places[k] - sim.host.positions[led.vertices[k]]) / sim.settings.dt;
    return;
  }
  if (!led.pass) led.pass.program = Program::compute("lead.comp", {}, led.defines);
  write_records(led);
}

double lag_of(const Sim& sim, const Fixture& fixture, const State& state) {
  double most = 0;
  for (const std::uint32_t v : fixture.vertices)
    if (is_pinned(sim, v))
      most = std::max(most, glm::distance(state.positions[v],
                                          moved_along(fixture.path, sim.model->positions[v], simulated_time(sim))));
  return most;
}

void aim_led(Sim& sim, int substep) {
  if (!sim.led.vertices.empty()) run(sim, aims, substep);
}

void lead(Sim& sim, int substep) {
  if (!sim.led.vertices.empty()) run(sim, goes, substep);
}

void end_leading(Sim& sim) {
  Led& led = sim.led;
  if (led.by_hand && on_cpu(sim))  // the scene's own go on
    for (const std::uint32_t v : led.vertices) sim.host.velocities[v] = glm::dvec3(0);
  else if (led.by_hand)
    run(sim, stops, 0);
  led.vertices.clear(), led.places.clear();
}

}  // namespace tetpbd
