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

// How far from its centre it is met by what it carries on `times` its displacement over h, |way - h (v + w x
// arm)| <= |way| + h (|v| + |w| |arm|): |arm| (1 - times h |w|) <= radius + times h |v| + times |way|.
glm::vec4 reach_block(const MovingObstacle& o, double h) {
  constexpr double times = 4;
  const double left = 1 - times * h * glm::length(o.spin), size = glm::length(o.pose.centre);
  const double reach = 1.01 * (o.reach + times * h * glm::length(o.velocity)) / left + 1e-6 * size;
  return {glm::vec3(o.pose.centre), left < 0.5 ? 1e18f : float(std::min(reach, 1e18))};  // squares are finite
}

ObstacleRecord record_block(const MovingObstacle& o, int first) {
  const auto& s = o.solid;
  ObstacleRecord block{};
  split_pair(o.pose.centre, block.centre, block.centre_low);
  block.right = glm::vec3(o.pose.axes[0]), block.up = glm::vec3(o.pose.axes[1]);
  block.front = glm::vec3(o.pose.axes[2]);
  block.kind = s.kind, block.convex = s.convex, block.first = first, block.cells = s.cells;
  block.extent = glm::vec3(s.extent), block.origin = glm::vec3(s.origin);
  block.radius = float(s.radius), block.spacing = float(s.spacing), block.trust = float(s.trust);
  block.velocity = glm::vec3(o.velocity), block.spin = glm::vec3(o.spin);
  block.friction = float(o.friction), block.own_friction = o.own_friction, block.restitution = float(o.restitution);
  return block;
}

std::vector<std::shared_ptr<const DistanceField>> obstacle_fields(const Model& model) {
  std::vector<std::shared_ptr<const DistanceField>> fields;
  for (const Obstacle* o : solid_obstacles(model)) fields.push_back(o->field);
  return fields;
}

std::pair<Buffer, Texture> make_texels(const char* label, const std::vector<float>& values, const char* remedy) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most);
  if (values.size() > std::size_t(most))
    throw Error(fmt::format("too many values for the {}", label),
                fmt::format("{} of them, the driver allows {}", values.size(), most), remedy, 1);
  std::pair<Buffer, Texture> made{Buffer(label, values), Texture(label, GL_TEXTURE_BUFFER)};
  glTexBuffer(GL_TEXTURE_BUFFER, GL_R32F, made.first.id());
  glBindTexture(GL_TEXTURE_BUFFER, 0);
  return made;
}
void bind_texels(int unit, const Texture& texture) {
  glActiveTexture(GL_TEXTURE0 + GLenum(unit));
  glBindTexture(GL_TEXTURE_BUFFER, texture.id());
  glActiveTexture(GL_TEXTURE0);
}

bool bodies_have_friction(const Model& model) {
  return std::ranges::any_of(model.bodies, [](const Body& body) { return body.friction.has_value(); });
}

}  // namespace

std::vector<std::string> obstacle_defines(const Model& model) {
  const auto solids = solid_obstacles(model);
  std::set<std::pair<int, std::string>> kinds;
  for (const Obstacle* o : solids) kinds.emplace(o->kind->number(), o->kind->function());
  std::string rows;
  for (const auto& [number, function] : kinds) rows += fmt::format(" ROW({}, {})", number, function);
  const bool fields = std::ranges::any_of(solids, [](const Obstacle* o) { return bool(o->field); });
  return {fmt::format("SOLIDS {}", solids.size()), fmt::format("FIELDS {:d}", fields),
          fmt::format("BODY_FRICTION {:d}", bodies_have_friction(model)), "OBSTACLE_KINDS(ROW)" + rows};
}

bool share_kernels(const Model& model, const Model& other) {
  return obstacle_defines(model) == obstacle_defines(other) && obstacle_fields(model) == obstacle_fields(other) &&
         model.obstacles.empty() == other.obstacles.empty();
}

Obstacles make_obstacles(const Model& model) {
  check_obstacles(model);
  Obstacles obstacles;
  if (bodies_have_friction(model)) {
    std::vector<float> values;
    for (const Body& body : model.bodies)
      values.resize(values.size() + body.vertices, float(body.friction.value_or(-1)));
    std::tie(obstacles.friction, obstacles.friction_texture) =
        make_texels("friction of vertices", values, "give all bodies the same friction");
  }
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

void write_planes(const Model& model, const Settings& settings, Step& block) {
  for (const MovingObstacle& o : obstacles_at(model, settings, 0))
    if (o.is_plane) block.planes[block.plane_count++] = glm::vec4(o.plane);
}

void write_obstacles(Sim& sim, int list) {
  Obstacles& obstacles = sim.obstacles;
  if (obstacles.bytes == 0) return;
  const bool single = on_cpu(sim) || std::ranges::none_of(sim.model->obstacles, moves);
  const int lists = single ? 1 : std::min(sim.plan.substeps + 1, Obstacles::most_lists);
  const double h = sim.plan.h, start = simulated_time(sim) - h;
  const auto fields = obstacle_fields(*sim.model);
  std::vector<char> bytes(std::size_t(lists) * obstacles.stride);
  for (int l = 0; l < lists; ++l) {
    char* reaches = bytes.data() + std::size_t(l) * obstacles.stride;
    char* records = reaches + fields.size() * sizeof(glm::vec4);
    int first = 0, k = 0;
    for (const MovingObstacle& o : obstacles_at(*sim.model, sim.settings, start + (list + l) * h, h)) {
      if (o.is_plane) continue;
      const ObstacleRecord record = record_block(o, first);
      const glm::vec4 reach = reach_block(o, h);
      std::memcpy(reaches + std::size_t(k) * sizeof reach, &reach, sizeof reach);
      std::memcpy(records + std::size_t(k) * sizeof record, &record, sizeof record);
      if (const auto& field = fields[std::size_t(k++)]) first += int(field->values.size());
    }
  }
  if (obstacles.records.bytes() == bytes.size())
    obstacles.records.write(0, bytes.size(), bytes.data());
  else
    obstacles.records = Buffer("obstacles", bytes, GL_STREAM_DRAW);
  obstacles.first = obstacles.present = list;
}

void bind_next_obstacles(Sim& sim) {
  Obstacles& obstacles = sim.obstacles;
  const int lists = int(obstacles.records.bytes() / obstacles.stride);
  if (++obstacles.present == obstacles.first + lists) write_obstacles(sim, obstacles.present);
  bind_obstacles(obstacles);
}

void bind_obstacles(const Obstacles& obstacles) {
  if (obstacles.friction) bind_texels(UNIT_FRICTION, obstacles.friction_texture);
  if (!obstacles.records) return;
  glBindBufferRange(GL_UNIFORM_BUFFER, BIND_OBSTACLES, obstacles.records.id(),
                    GLintptr(std::size_t(obstacles.present - obstacles.first) * obstacles.stride),
                    GLsizeiptr(obstacles.bytes));
  if (obstacles.fields) bind_texels(UNIT_FIELDS, obstacles.fields_texture);
}

}  // namespace tetpbd
