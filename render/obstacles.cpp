#include "render/obstacles.h"

#include <algorithm>
#include <cstddef>

#include "render/layout.h"
#include "render/renderer.h"
#include "sim/contact/obstacle_kinds.h"

namespace tetpbd {

namespace {

bool looks_alike(const Obstacle& a, const Obstacle& b) {
  return a.kind == b.kind && a.radius == b.radius && a.half_length == b.half_length && a.half == b.half &&
         a.field == b.field && a.surface == b.surface;
}

// Makes the surfaces anew if the obstacles have changed, as they may in the window.
void make_surfaces(ObstacleSurfaces& surfaces, const Model& model) {
  if (std::ranges::equal(model.obstacles, surfaces.made_of, looks_alike)) return;
  std::vector<ObstacleCorner> corners;
  surfaces.first = {0};
  for (const Obstacle& o : model.obstacles) {
    const std::vector<ObstacleCorner> own = tessellate(o);
    corners.insert(corners.end(), own.begin(), own.end());
    surfaces.first.push_back(int(corners.size()));
  }
  surfaces.corners = Buffer("surfaces of obstacles", corners);
  surfaces.array = VertexArray("obstacles");
  const auto part = [&](GLuint index, std::size_t offset) {
    attribute(index, surfaces.corners.id(), 3, sizeof(ObstacleCorner), offset);
  };
  part(ATTRIBUTE_HIGH, offsetof(ObstacleCorner, position));
  part(ATTRIBUTE_NORMAL, offsetof(ObstacleCorner, normal));
  surfaces.made_of = model.obstacles;
}

bool is_flat(const Obstacle& o) { return o.kind->flat; }

}  // namespace

Bounds with_obstacles(const Bounds& box, const Model& model, double time, double reach) {
  Bounds all = box;
  for (const Obstacle& o : model.obstacles) {
    if (!o.kind->half) continue;
    const Pose pose = pose_at(o, time);
    const glm::dmat3 sizes{glm::abs(pose.axes[0]), glm::abs(pose.axes[1]), glm::abs(pose.axes[2])};
    const glm::dvec3 half = sizes * o.kind->half(o), low = box.low - reach, high = box.high + reach;
    all.low = glm::min(all.low, glm::clamp(pose.centre - half, low, high));
    all.high = glm::max(all.high, glm::clamp(pose.centre + half, low, high));
  }
  return all;
}

bool has_surfaces(const Frame& frame) { return frame.model && !std::ranges::all_of(frame.model->obstacles, is_flat); }

std::vector<glm::vec4> find_planes(const Frame& frame) {
  std::vector<glm::vec4> planes;
  if (frame.ground) planes.emplace_back(0, 1, 0, *frame.ground);
  for (std::size_t i = 0; frame.model && i < frame.model->obstacles.size(); ++i) {
    const Obstacle& o = frame.model->obstacles[i];
    if (!is_flat(o)) continue;
    const Pose pose = pose_at(o, frame.time);
    planes.emplace_back(glm::vec3(pose.axes[1]), float(glm::dot(pose.axes[1], pose.centre)));
  }
  return planes;
}

void draw_obstacles(Renderer& renderer, const Frame& frame, bool shadow) {
  if (!has_surfaces(frame)) return;
  ObstacleSurfaces& surfaces = renderer.obstacles;
  make_surfaces(surfaces, *frame.model);
  const Program& program = use(renderer, shadow ? "obstacles shadow" : "obstacles");
  glBindVertexArray(surfaces.array.id());
  for (std::size_t i = 0; i < frame.model->obstacles.size(); ++i) {
    if (surfaces.first[i] == surfaces.first[i + 1]) continue;
    const Pose pose = pose_at(frame.model->obstacles[i], frame.time);
    const glm::mat3 axes(pose.axes);
    program.set("right", axes[0]), program.set("up", axes[1]), program.set("front", axes[2]);
    program.set("centre", glm::vec3(pose.centre));
    if (!shadow) program.set("chosen", frame.chosen_obstacle == int(i) ? 1 : 0);
    glDrawArrays(GL_TRIANGLES, surfaces.first[i], surfaces.first[i + 1] - surfaces.first[i]);
  }
}

}  // namespace tetpbd
