#include "app/window/probe.h"

#include <algorithm>
#include <cmath>

#include "render/frame.h"
#include "render/layout.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

namespace measures {
using glm::cross, glm::distance, glm::dot, glm::determinant, glm::inverse, glm::mat3, glm::transpose, glm::vec3,
    glm::vec4, glm::abs, glm::max, glm::clamp, std::log;
// clang-format off: in this order
#include "shaders/energy.glsl"
#include "shaders/render/values.glsl"
// clang-format on
}  // namespace measures

std::uint32_t tet_behind(const TetMesh& mesh, const Triangle& face) {
  const auto has = [&](const Tet& tet) {
    return std::ranges::all_of(face, [&](std::uint32_t v) { return std::ranges::count(tet, v) > 0; });
  };
  return std::uint32_t(std::ranges::find_if(mesh.tets, has) - mesh.tets.begin());
}

// Floats of the copy: the positions, the vertex's velocity, its distance.
std::size_t velocity_at(const Probe& probe) { return probe.read.size() * sizeof(Position) / 4; }
std::size_t distance_at(const Probe& probe) { return velocity_at(probe) + sizeof(Velocity) / 4; }

void copy_values(Probe& probe, const Lane& lane) {
  const auto& tet = lane.sim.model->rest.tets[probe.next.tet];
  const std::size_t vertex = probe.next.vertex;
  const Averages& averages = lane.sim.system.averages;
  probe.read.assign(tet.begin(), tet.end());
  if (has_averages(lane.sim.system))
    for (std::uint32_t k = averages.first_neighbour[vertex]; k < averages.first_neighbour[vertex + 1]; ++k)
      probe.read.push_back(averages.neighbours[k].vertex);
  const std::size_t bytes = (distance_at(probe) + 1) * 4;
  if (!probe.copy || probe.copy.bytes() < bytes) probe.copy = Buffer("probe", bytes, nullptr, GL_STREAM_READ);
  for (std::size_t i = 0; i < probe.read.size(); ++i)
    lane.positions().copy_to(probe.copy, i * sizeof(Position), probe.read[i] * sizeof(Position), sizeof(Position));
  lane.velocities().copy_to(probe.copy, velocity_at(probe) * 4, vertex * sizeof(Velocity), sizeof(Velocity));
  if (lane.apart) lane.apart.copy_to(probe.copy, distance_at(probe) * 4, vertex * 4, 4);
  probe.copied = Fence::here();
}

std::array<glm::dvec3, 4> corners_of(const Tet& tet, const std::vector<glm::dvec3>& positions) {
  return {positions[tet[0]], positions[tet[1]], positions[tet[2]], positions[tet[3]]};
}

Reading reading_of(const Probe& probe, const Lane& lane, const std::vector<float>& values) {
  Reading reading = probe.next;
  const Model& model = *lane.sim.model;
  const Averages& averages = lane.sim.system.averages;
  const auto pair = [&](std::size_t at) {
    return glm::dvec3(values[at], values[at + 1], values[at + 2]) +
           glm::dvec3(values[at + 4], values[at + 5], values[at + 6]);
  };
  std::vector<glm::dvec3> now(model.positions.size());  // where they were read
  for (std::size_t i = 0; i < probe.read.size(); ++i) now[probe.read[i]] = pair(8 * i);
  reading.position = now[reading.vertex];
  reading.speed = glm::length(pair(velocity_at(probe)));
  const glm::vec4 material = tet_energy_material(model, lane.sim.settings, reading.tet);
  const TetValues measured = tet_values(model, reading.tet, corners_of(model.rest.tets[reading.tet], now), material);
  reading.volume = double(measured.volume), reading.strain = double(measured.strain);
  if (material.z > 0) reading.energy = double(measured.energy);
  if (material.z == 3 && probe.read.size() > 4) {
    reading.volume = average_at(averages, reading.vertex, now).J - 1;
    *reading.energy += double(average_energy(averages, reading.vertex, now, material));
  }
  if (lane.apart) reading.distance = double(values[distance_at(probe)]);
  return reading;
}

}  // namespace

TetValues tet_values(const Model& model, std::size_t tet, const std::array<glm::dvec3, 4>& corners,
                     const glm::vec4& material) {
  const Tet& ids = model.rest.tets[tet];
  glm::vec3 now[4], rest[4];
  for (std::size_t i = 0; i < 4; ++i) {
    now[i] = glm::vec3(corners[i] - corners[0]);
    rest[i] = glm::vec3(model.rest.positions[ids[i]] - model.rest.positions[ids[0]]);
  }
  return {measures::tet_value(COLOUR_VOLUME, now, rest, material),
          measures::tet_value(COLOUR_STRETCH, now, rest, material),
          measures::tet_value(COLOUR_ENERGY, now, rest, material)};
}

float average_energy(const Averages& averages, std::size_t vertex, const std::vector<glm::dvec3>& positions,
                     const glm::vec4& material) {
  const Average at = average_at(averages, vertex, positions);
  return measures::averaged_energy(glm::mat3(at.F), float(at.J), material);
}

void ask(Probe& probe, const std::vector<Lane>& lanes, std::size_t lane, Renderer& renderer, const Frame& frame,
         const Ray& ray) {
  const Sim& sim = lanes[lane].sim;
  if (!probe.picker.kernel) probe.picker = make_picker(sim.model->rest);
  probe.copied = {};
  probe.lane = lane;
  request(probe.picker, renderer, frame, ray);
}

bool take_reading(Probe& probe, const std::vector<Lane>& lanes, bool wait) {
  if (probe.lane >= lanes.size()) return probe = {}, true;
  const Lane& lane = lanes[probe.lane];
  if (const auto pick = poll(probe.picker, wait)) {
    if (!pick->hit) return probe.reading.reset(), true;
    const TetMesh& mesh = lane.sim.model->rest;
    probe.next = {.vertex = pick->vertex,
                  .tet = pick->inside ? pick->element : tet_behind(mesh, mesh.surface[pick->element])};
    if (probe.next.tet == mesh.tets.size()) return probe.reading.reset(), true;  // of a sheet
    copy_values(probe, lane);
  }
  const auto values = poll_readback<float>(probe.copied, probe.copy, "reading what is under the cursor", wait);
  if (values) probe.reading = reading_of(probe, lane, *values);
  return values.has_value();
}

}  // namespace tetpbd
