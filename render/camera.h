// A camera that looks at a target from a distance. +y is up; lengths are in metres, angles in degrees.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace tetpbd {

struct Camera {
  glm::vec3 target{0.0f};
  float distance = 3.0f;
  float azimuth = 30.0f;    ///< about +y; 0 looks from +z, 90 from +x
  float elevation = 18.0f;  ///< above the horizon, -89..89
  float fov = 35.0f;        ///< of the shorter side of the picture
};

/// A camera on a path.
struct CameraKey {
  double time = 0;  ///< s
  Camera camera;
};

struct Ray {
  glm::vec3 origin{0.0f};
  glm::vec3 direction{0.0f, 0.0f, -1.0f};  ///< unit length
};

void orbit(Camera& camera, float azimuth_degrees, float elevation_degrees);
/// Moves the target so that objects at its depth follow a cursor by (dx, dy) pixels (y down). `shorter_side` is that of
/// the viewport, in pixels.
void pan(Camera& camera, float dx, float dy, int shorter_side);
/// Multiplies the distance by a factor; below 1 the camera comes closer.
void zoom(Camera& camera, float factor);
/// Moves the target towards `goal`, two thirds of the way in 0.3 s, in steps of any length.
void follow(Camera& camera, const glm::vec3& goal, float seconds);
/// Moves the target, by no more than it has to, until a point is in the middle half of the view.
void keep_in_view(Camera& camera, const glm::vec3& point, float aspect);
/// The camera at a time (s) on a smooth path through all keys, which are in order of time and at least one. Before the
/// first and after the last key it stands still.
Camera camera_at(const std::vector<CameraKey>& path, double time);
/// Looks at the centre of a box from where all of it is in view, with `margin` around it (1: none).
void frame_box(Camera& camera, const glm::vec3& low, const glm::vec3& high, float aspect, float margin = 1.15f);

glm::vec3 eye(const Camera& camera);
glm::mat4 view_matrix(const Camera& camera);
glm::mat4 projection_matrix(const Camera& camera, float aspect);
/// The ray through a point of the viewport, in pixels from its top left (the first pixel has its centre at 0.5, 0.5).
Ray pixel_ray(const Camera& camera, float x, float y, int width, int height);

}  // namespace tetpbd
