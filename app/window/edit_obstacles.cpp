#include "app/window/edit_obstacles.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "app/obstacles.h"
#include "sim/contact/moving_obstacle.h"

namespace tetpbd {

void change_obstacles(Session& s, std::vector<Obstacle> wanted) { emit(s, action::SetObstacles{std::move(wanted)}); }

void choose_obstacle(Session& s, int number) {
  if (std::exchange(s.obstacle, number) != number) s.log("obstacle {} chosen", number + 1);
}

namespace {

// Beside the bodies, as the camera sees them.
Obstacle new_obstacle(const Session& s, const ObstacleKind& kind, double size) {
  Obstacle o;
  o.kind = &kind;
  o.normal = {0, 1, 0};
  o.radius = kind.has("half_length") ? 0.5 * size : size;
  o.half_length = size;
  o.half = kind.has("heights") ? size * glm::dvec3(2, 0.8, 2) : glm::dvec3(size);
  o.height = kind.has("mesh") ? 2 * size : 0;
  if (kind.has("mesh")) o.mesh = found_file(s.ui.mesh, {});
  for (int k = 0; kind.has("heights") && k < 24; ++k)
    for (int i = 0; i < 24; ++i) {
      if (i == 0) o.heights.emplace_back();
      o.heights.back().push_back(std::round(50 + 25 * (std::sin(0.6 * i) + std::cos(0.5 * k))) / 100);
    }
  const Settings& world = s.loaded.sim().settings;
  const double angle = glm::radians(double(s.camera.azimuth) + 60);
  o.centre = glm::dvec3(s.camera.target) +
             (kind.has("heights") ? 5 : 3) * size * glm::dvec3(std::sin(angle), 0, std::cos(angle));
  if (world.ground) o.centre.y = world.ground_height + (kind.half ? kind.half(o).y : 0);
  return o;
}

}  // namespace

void add_obstacle(Session& s, const ObstacleKind& kind) {
  between_steps(s, [&s, &kind] {
    const double size = 0.2 * s.loaded.model->size;
    std::vector<Obstacle> wanted = s.loaded.scene.obstacles;
    wanted.push_back(new_obstacle(s, kind, size));
    const std::size_t count = wanted.size();
    change_obstacles(s, std::move(wanted));
    if (s.loaded.scene.obstacles.size() != count) return;
    choose_obstacle(s, int(count) - 1);
    // It is to be seen whole, or nobody knows that it is there.
    const glm::mat4 seen = projection_matrix(s.camera, s.aspect) * view_matrix(s.camera);
    for (int corner = 0; corner < 8; ++corner) {
      const glm::vec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : 0, corner & 4 ? 1 : -1);
      const glm::vec4 at = seen * glm::vec4(glm::vec3(s.loaded.scene.obstacles.back().centre) + float(size) * side, 1);
      if (at.w <= 0 || std::max(std::abs(at.x), std::abs(at.y)) > at.w) return frame_body(s);
    }
  });
}

void remove_obstacle(Session& s) {
  if (s.obstacle < 0) return;
  std::vector<Obstacle> wanted = asked_obstacles(s);
  wanted.erase(wanted.begin() + s.obstacle);
  s.obstacle = -1;
  change_obstacles(s, std::move(wanted));
}

void move_by(Obstacle& o, const glm::dvec3& way) {
  o.centre += way;
  for (Obstacle::Key& key : o.keyframes) key.centre += way;
}

void turn_by(Obstacle& o, const glm::dmat3& turn) {
  const glm::dmat3 now = turn * rotation_of(o.rotation);
  const glm::dvec3 before = o.rotation;
  o.rotation = glm::degrees(glm::dvec3(std::atan2(now[1].z, now[2].z), std::asin(std::clamp(-now[0].z, -1.0, 1.0)),
                                       std::atan2(now[0].y, now[0].x)));
  for (Obstacle::Key& key : o.keyframes) key.rotation += o.rotation - before;
  o.spin = turn * o.spin;
  o.normal = turn * o.normal;
}

namespace {

glm::dvec3 chosen_centre(const Session& s) {
  return pose_at(asked_obstacles(s)[std::size_t(s.obstacle)], s.loaded.lane().time()).centre;
}

// On the screen, of the arrow along an axis.
std::pair<glm::vec2, glm::vec2> gizmo_ends(const Session& s, const Rect& place, int axis) {
  glm::dvec3 tip = chosen_centre(s);
  const glm::vec2 root = seen_at(s, place, tip);
  tip[axis] += gizmo_length(s);
  return {root, seen_at(s, place, tip)};
}

}  // namespace

bool in_front(const Session& s, const glm::dvec3& point) {
  return glm::dot(glm::vec3(point) - eye(s.camera), s.camera.target - eye(s.camera)) > 0;
}

double gizmo_length(const Session& s) {
  const glm::vec3 way = glm::vec3(chosen_centre(s)) - eye(s.camera);
  const glm::vec3 forward = glm::normalize(s.camera.target - eye(s.camera));
  return 0.12 * double(std::max(glm::dot(way, forward), 1e-3f * s.camera.distance));
}

std::optional<int> gizmo_at(const Session& s, const Rect& place, glm::vec2 cursor) {
  const float near = 9 * s.ui.scale;
  std::optional<int> found;
  float least = near;
  for (int axis = 0; axis < 3 && s.obstacle >= 0 && in_front(s, chosen_centre(s)); ++axis) {
    const auto [root, tip] = gizmo_ends(s, place, axis);
    const glm::vec2 way = tip - root;
    // Of the arrow's outer part: at its root the arrows are one.
    const float part = std::clamp(glm::dot(cursor - root, way) / std::max(glm::dot(way, way), 1.0f), 0.4f, 1.0f);
    if (const float far = glm::distance(cursor, root + part * way); far < least) least = far, found = axis;
  }
  return found;
}

double along_gizmo(const Session& s, const Rect& place, int axis, glm::vec2 moved) {
  const auto [root, tip] = gizmo_ends(s, place, axis);
  const glm::vec2 way = tip - root;
  // Of an arrow that points at the eye a pixel would be metres.
  return gizmo_length(s) * double(glm::dot(moved, way) / std::max(glm::dot(way, way), 100.0f));
}

std::optional<ObstacleHit> obstacle_on(const Session& s, const Ray& ray) {
  std::optional<ObstacleHit> first;
  const double size = s.loaded.model->size, far = 100 * (size + double(s.camera.distance));
  const auto& all = s.loaded.scene.obstacles;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const MovingObstacle obstacle = moving_obstacle(all[i], s.loaded.lane().time(), 0);
    double t = 0, gap = 0;
    for (int turn = 0; turn < 400 && t < far; ++turn) {
      gap = obstacle.surface_at(glm::dvec3(ray.origin) + t * glm::dvec3(ray.direction)).distance;
      if (gap < 1e-4 * size) break;
      t += std::max(gap * all[i].trust, 1e-4 * size);
    }
    if (gap < 1e-4 * size && t > 0 && t < far && (!first || t < first->distance)) first = ObstacleHit{int(i), t};
  }
  return first;
}

}  // namespace tetpbd
