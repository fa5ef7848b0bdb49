#include "sim/contact/obstacles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/sim.h"

namespace tetpbd {

namespace {

// The centre, and how far from there a vertex at arm that moves by u may meet the obstacle within `times` substeps.
// Relative to it the vertex moves by |u - h (v + w x arm)| <= |u| + h (|v| + |w| |arm|) in each, hence
// |arm| (1 - times h |w|) <= reach + times (h |v| + |u|); kernels add the term with u.
glm::vec4 bound_contacts(const MovingObstacle& o, double h) {
  constexpr double times = 4;
  const double left = 1 - times * h * glm::length(o.spin), size = glm::length(o.pose.centre);
  const double reach = 1.01 * (o.reach + times * h * glm::length(o.velocity)) / left + 1e-6 * size;
  return {glm::vec3(o.pose.centre), left < 0.5 ? 1e18f : float(std::min(reach, 1e18))};  // squares are finite
}

ObstacleRecord make_record(const MovingObstacle& o, int first) {
  const auto& s = o.solid;
  ObstacleRecord record{};
  split_double_single(o.pose.centre, record.centre, record.centre_low);
  record.right = glm::vec3(o.pose.axes[0]), record.up = glm::vec3(o.pose.axes[1]);
  record.front = glm::vec3(o.pose.axes[2]);
  record.kind = s.kind, record.convex = s.convex, record.first = first, record.cells = s.cells;
  record.extent = glm::vec3(s.extent), record.origin = glm::vec3(s.origin);
  record.radius = float(s.radius), record.spacing = float(s.spacing), record.trust = float(s.trust);
  record.velocity = glm::vec3(o.velocity), record.spin = glm::vec3(o.spin);
  record.friction = float(o.friction.value_or(-1)), record.restitution = float(o.restitution.value_or(-1));
  return record;
}

std::vector<std::shared_ptr<const DistanceField>> obstacle_fields(const Model& model) {
  std::vector<std::shared_ptr<const DistanceField>> fields;
  for (const Obstacle* o : solid_obstacles(model)) fields.push_back(o->field);
  return fields;
}

// Two numbers by vertex; the world's where a body has none of its own.
std::vector<float> surface_values(const Model& model, const Settings& settings) {
  std::vector<float> values;
  values.reserve(2 * model.positions.size());
  for (const Body& body : model.bodies)
    for (std::size_t i = 0; i < body.vertices; ++i)
      values.insert(values.end(),
                    {float(friction_of(settings, body.number)), float(restitution_of(settings, body.number))});
  return values;
}

}  // namespace

std::vector<std::string> obstacle_defines(const Model& model, bool own_surfaces) {
  const auto solids = solid_obstacles(model);
  std::set<std::pair<int, std::string>> kinds;
  for (const Obstacle* o : solids) kinds.emplace(o->kind->number(), o->kind->function());
  std::string rows;
  for (const auto& [number, function] : kinds) rows += fmt::format(" ROW({}, {})", number, function);
  const bool fields = std::ranges::any_of(solids, [](const Obstacle* o) { return bool(o->field); });
  return {fmt::format("SOLIDS {}", solids.size()),
          fmt::format("FIELDS {:d}", fields),
          fmt::format("BODY_SURFACES {:d}", own_surfaces),
          fmt::format("LOADED {:d}", !model.loads.empty()),
          fmt::format("MOVING_SOLIDS {:d}", std::ranges::any_of(model.obstacles, moves)),
          "OBSTACLE_KINDS(ROW)" + rows};
}

bool share_kernels(const Model& model, const Model& other) {
  return obstacle_defines(model, false) == obstacle_defines(other, false) &&
         obstacle_fields(model) == obstacle_fields(other) && model.obstacles.empty() == other.obstacles.empty();
}

Obstacles make_obstacles(const Model& model, const Settings& settings) {
  constexpr std::size_t most = MAX_OBSTACLES - 1;
  if (model.obstacles.size() > most)
    throw Error("too many obstacles", fmt::format("{} of them", model.obstacles.size()),
                fmt::format("at most {} beside the ground", most));
  Obstacles obstacles;
  if (has_own_surfaces(settings))
    std::tie(obstacles.surfaces, obstacles.surfaces_texture) = make_texels(
        "friction and restitution of vertices", surface_values(model, settings), "give all bodies the same");
  const std::size_t count = solid_obstacles(model).size();
  if (count == 0) return obstacles;
  GLint alignment = 256;
  glGetIntegerv(GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT, &alignment);
  const std::size_t unit = std::size_t(alignment);
  obstacles.bytes = count * (sizeof(glm::vec4) + sizeof(ObstacleRecord));
  obstacles.stride = (obstacles.bytes + unit - 1) / unit * unit;
  std::vector<float> values;
  for (const auto& field : obstacle_fields(model))
    if (field) values.insert(values.end(), field->values.begin(), field->values.end());
  if (!values.empty())
    std::tie(obstacles.fields, obstacles.fields_texture) =
        make_texels("fields of obstacles", values, "give their meshes fewer voxels");
  return obstacles;
}

void write_surfaces(Sim& sim) {
  if (!sim.obstacles.surfaces) return;
  const std::vector<float> values = surface_values(*sim.model, sim.settings);
  sim.obstacles.surfaces.write(0, values.size() * sizeof(float), values.data());
}

void write_planes(const Model& model, const Settings& settings, Step& block) {
  for (const MovingObstacle& o : obstacles_at(model, settings, 0))
    if (o.is_plane) block.planes[block.plane_count++] = glm::vec4(o.plane);
}

void write_obstacles(Sim& sim, int first) {
  Obstacles& obstacles = sim.obstacles;
  if (obstacles.bytes == 0) return;  // all are planes
  const bool single = on_cpu(sim) || std::ranges::none_of(sim.model->obstacles, moves);
  const int lists = single ? 1 : std::min(sim.plan.substeps + 1, Obstacles::most_lists);
  const double h = sim.plan.h, start = simulated_time(sim) - h;
  const auto fields = obstacle_fields(*sim.model);
  std::vector<char> bytes(std::size_t(lists) * obstacles.stride);
  for (int l = 0; l < lists; ++l) {
    char* reaches = bytes.data() + std::size_t(l) * obstacles.stride;
    char* records = reaches + fields.size() * sizeof(glm::vec4);
    int first_value = 0;
    std::size_t k = 0;
    for (const MovingObstacle& o : obstacles_at(*sim.model, sim.settings, start + (first + l) * h, h)) {
      if (o.is_plane) continue;
      const ObstacleRecord record = make_record(o, first_value);
      const glm::vec4 reach = bound_contacts(o, h);
      std::memcpy(reaches + k * sizeof reach, &reach, sizeof reach);
      std::memcpy(records + k * sizeof record, &record, sizeof record);
      if (const auto& field = fields[k++]) first_value += int(field->values.size());
    }
  }
  if (obstacles.records.bytes() == bytes.size())
    obstacles.records.write(0, bytes.size(), bytes.data());
  else
    obstacles.records = Buffer("obstacles", bytes, GL_STREAM_DRAW);
  obstacles.first = obstacles.present = first;
}

void bind_next_obstacles(Sim& sim) {
  Obstacles& obstacles = sim.obstacles;
  const int lists = int(obstacles.records.bytes() / obstacles.stride);
  if (++obstacles.present == obstacles.first + lists) write_obstacles(sim, obstacles.present);
  bind_obstacles(obstacles);
}

void bind_obstacles(const Obstacles& obstacles) {
  if (obstacles.surfaces) bind_texels(UNIT_SURFACES, obstacles.surfaces_texture);
  if (!obstacles.records) return;
  glBindBufferRange(GL_UNIFORM_BUFFER, BIND_OBSTACLES, obstacles.records.id(),
                    GLintptr(std::size_t(obstacles.present - obstacles.first) * obstacles.stride),
                    GLsizeiptr(obstacles.bytes));
  if (obstacles.fields) bind_texels(UNIT_FIELDS, obstacles.fields_texture);
}

}  // namespace tetpbd
