#include "render/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

namespace tetpbd {

// The tangent of half the vertical field of view.
static float half_height(const Camera& camera, float aspect) {
  return std::tan(glm::radians(camera.fov) * 0.5f) / std::min(aspect, 1.0f);
}

void orbit(Camera& camera, float azimuth_degrees, float elevation_degrees) {
  camera.azimuth = std::remainder(camera.azimuth + azimuth_degrees, 360.0f);
  // A camera that looks straight up or down has no direction that is up on the screen.
  camera.elevation = std::clamp(camera.elevation + elevation_degrees, -89.0f, 89.0f);
}

void pan(Camera& camera, float dx, float dy, int shorter_side) {
  const float metres = 2.0f * camera.distance * half_height(camera, 1) / float(std::max(shorter_side, 1));
  const glm::mat4 view = view_matrix(camera);
  const glm::vec3 right{view[0][0], view[1][0], view[2][0]}, up{view[0][1], view[1][1], view[2][1]};
  camera.target += metres * (-dx * right + dy * up);
}

void zoom(Camera& camera, float factor) { camera.distance = std::clamp(camera.distance * factor, 1e-3f, 1e5f); }

void follow(Camera& camera, const glm::vec3& goal, float seconds) {
  camera.target += (goal - camera.target) * (1.0f - std::exp(-seconds / 0.3f));
}

void keep_in_view(Camera& camera, const glm::vec3& point, float aspect) {
  const glm::mat3 rotation(view_matrix(camera));
  const float tan_y = half_height(camera, aspect);
  const glm::vec3 off = rotation * (point - camera.target);  // its z points towards the eye
  const float nearer = 0.5f * camera.distance, depth = camera.distance - std::clamp(off.z, -nearer, nearer);
  const glm::vec3 most{0.55f * depth * tan_y * aspect, 0.55f * depth * tan_y, nearer};
  camera.target += glm::transpose(rotation) * (off - glm::clamp(off, -most, most));
}

Camera camera_at(const std::vector<CameraKey>& path, double time) {
  const auto next = std::ranges::upper_bound(path, time, {}, &CameraKey::time);
  if (next == path.begin()) return path.front().camera;
  if (next == path.end()) return path.back().camera;
  const CameraKey &b = next[-1], &c = *next, &a = next - 1 == path.begin() ? b : next[-2],
                  &d = next + 1 == path.end() ? c : next[1];
  const float u = float((time - b.time) / (c.time - b.time)), v = 1 - u;
  const float before = float((c.time - b.time) / (c.time - a.time)),
              after = float((c.time - b.time) / (d.time - b.time));
  // A cubic whose slope at each key is that between the key's neighbours.
  const auto mixed = [&](auto part) {
    return v * v * (1 + 2 * u) * (b.camera.*part) + u * u * (1 + 2 * v) * (c.camera.*part) +
           u * v * v * before * (c.camera.*part - a.camera.*part) -
           u * u * v * after * (d.camera.*part - b.camera.*part);
  };
  return {mixed(&Camera::target), std::max(mixed(&Camera::distance), 1e-4f), mixed(&Camera::azimuth),
          std::clamp(mixed(&Camera::elevation), -89.0f, 89.0f), mixed(&Camera::fov)};
}

void frame_box(Camera& camera, const glm::vec3& low, const glm::vec3& high, float aspect, float margin) {
  camera.target = 0.5f * (low + high);
  const glm::mat3 rotation(view_matrix(camera));
  const float tan_y = half_height(camera, aspect), tan_x = tan_y * aspect;
  float distance = 1e-3f;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::vec3 point{corner & 1 ? high.x : low.x, corner & 2 ? high.y : low.y, corner & 4 ? high.z : low.z};
    const glm::vec3 p = rotation * (point - camera.target);  // its z points towards the eye
    distance = std::max({distance, p.z + margin * std::abs(p.x) / tan_x, p.z + margin * std::abs(p.y) / tan_y});
  }
  camera.distance = distance;
}

glm::vec3 eye(const Camera& camera) {
  const float azimuth = glm::radians(camera.azimuth), elevation = glm::radians(camera.elevation);
  const glm::vec3 backward{std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                           std::cos(elevation) * std::cos(azimuth)};
  return camera.target + camera.distance * backward;
}

glm::mat4 view_matrix(const Camera& camera) {
  return glm::lookAt(eye(camera), camera.target, glm::vec3(0.0f, 1.0f, 0.0f));
}

glm::mat4 projection_matrix(const Camera& camera, float aspect) {
  return glm::perspective(2.0f * std::atan(half_height(camera, aspect)), aspect, camera.distance * 0.01f,
                          camera.distance * 100.0f);
}

Ray pixel_ray(const Camera& camera, float x, float y, int width, int height) {
  const float aspect = float(width) / float(height), tan_y = half_height(camera, aspect), tan_x = tan_y * aspect;
  const glm::vec3 seen{(2.0f * x / float(width) - 1.0f) * tan_x, (1.0f - 2.0f * y / float(height)) * tan_y, -1.0f};
  return {eye(camera), glm::normalize(glm::transpose(glm::mat3(view_matrix(camera))) * seen)};
}

}  // namespace tetpbd
