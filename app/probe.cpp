#include "app/probe.h"

#include <algorithm>
#include <cmath>

#include "render/frame.h"
#include "render/layout.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

namespace measures {
using glm::cross, glm::distance, glm::dot, glm::inverse, glm::mat3, glm::vec3, glm::vec4, glm::abs, glm::max, std::log;
// clang-format off: in this order
#include "shaders/energy.glsl"
#include "shaders/render/values.glsl"
// clang-format on
}  // namespace measures

// Floats of the copy: the tet's positions, the vertex's velocity, its distance.
constexpr std::size_t of_velocity = 4 * sizeof(Position) / 4, of_distance = of_velocity + sizeof(Velocity) / 4;

std::uint32_t tet_behind(const TetMesh& mesh, const Triangle& face) {
  const auto has = [&](const Tet& tet) {
    return std::ranges::all_of(face, [&](std::uint32_t v) { return std::ranges::count(tet, v) > 0; });
  };
  return std::uint32_t(std::ranges::find_if(mesh.tets, has) - mesh.tets.begin());
}

void copy_values(Probe& probe, const Lane& lane) {
  if (!probe.copy) probe.copy = Buffer("probe", (of_distance + 1) * 4, nullptr, GL_STREAM_READ);
  const auto& tet = lane.sim.model->rest.tets[probe.next.tet];
  for (std::size_t i = 0; i < 4; ++i)
    lane.sim.positions.copy_to(probe.copy, i * sizeof(Position), tet[i] * sizeof(Position), sizeof(Position));
  const std::size_t vertex = probe.next.vertex;
  lane.sim.velocities.copy_to(probe.copy, of_velocity * 4, vertex * sizeof(Velocity), sizeof(Velocity));
  if (lane.apart) lane.apart.copy_to(probe.copy, of_distance * 4, vertex * 4, 4);
  probe.copied = Fence::here();
}

Reading reading_of(Reading reading, const Lane& lane, const std::vector<float>& values) {
  const Model& model = *lane.sim.model;
  const Tet& tet = model.rest.tets[reading.tet];
  const auto pair = [&](std::size_t at) {
    return glm::dvec3(values[at], values[at + 1], values[at + 2]) +
           glm::dvec3(values[at + 4], values[at + 5], values[at + 6]);
  };
  std::array<glm::dvec3, 4> now;
  for (std::size_t i = 0; i < 4; ++i) {
    now[i] = pair(8 * i);
    if (tet[i] == reading.vertex) reading.position = now[i];
  }
  reading.speed = glm::length(pair(of_velocity));
  const glm::vec4 material = energy_material(body_material(body_at(model, reading.vertex), lane.sim.settings));
  const TetValues measured = tet_values(model, reading.tet, now, material);
  reading.volume = double(measured.volume), reading.strain = double(measured.strain);
  if (material.z > 0) reading.energy = double(measured.energy);
  if (lane.apart) reading.distance = double(values[of_distance]);
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
  if (values) probe.reading = reading_of(probe.next, lane, *values);
  return values.has_value();
}

}  // namespace tetpbd
