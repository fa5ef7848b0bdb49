#include "sim/moving_shape.h"

#define GLM_ENABLE_EXPERIMENTAL  // euler_angles

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtx/euler_angles.hpp>
#include <limits>

namespace tetpbd {

bool moves(const Obstacle& o) {
  return o.velocity != glm::dvec3(0) || o.spin != glm::dvec3(0) || !o.keyframes.empty();
}

bool is_plane(const Obstacle& o) {
  return o.shape == SHAPE_PLANE && !moves(o) && !o.friction && !o.restitution;
}

glm::dmat3 rotation_of(const glm::dvec3& degrees) {
  const glm::dvec3 angle = glm::radians(degrees);
  return glm::dmat3(glm::eulerAngleZYX(angle.z, angle.y, angle.x));
}

std::vector<double> numbers_of(const Obstacle& o) {
  std::vector<double> all = {double(o.shape), o.radius, o.half_length, o.friction.value_or(-1),
                             o.restitution.value_or(-1)};
  const auto add = [&](const glm::dvec3& v) { all.insert(all.end(), {v.x, v.y, v.z}); };
  for (const glm::dvec3& v : {o.centre, o.normal, o.rotation, o.half, o.velocity, o.spin}) add(v);
  for (const Obstacle::Key& key : o.keyframes) all.push_back(key.time), add(key.centre), add(key.rotation);
  if (o.field) add(o.field->origin), all.push_back(o.field->spacing);
  return all;
}

namespace {

// How the shape stands when it is not turned: half spaces have their normal for y.
glm::dmat3 own_axes(const Obstacle& o) {
  if (o.shape != SHAPE_PLANE) return glm::dmat3(1);
  const glm::dvec3 up = glm::normalize(o.normal);
  const glm::dvec3 side = std::abs(up.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  const glm::dvec3 right = glm::normalize(glm::cross(up, side));
  return {right, up, glm::cross(right, up)};
}

glm::dmat3 turn_by(const glm::dvec3& turn) {
  const double angle = glm::length(turn);
  return angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, turn / angle)) : glm::dmat3(1);
}

}  // namespace

void set_heights(Obstacle& o, const std::vector<std::vector<double>>& rows) {
  auto field = std::make_shared<DistanceField>();
  field->size = {int(rows[0].size()), 1, int(rows.size())};
  const double dx = 2 * o.half.x / (field->size.x - 1), dz = 2 * o.half.z / (field->size.z - 1);
  field->spacing = std::min(dx, dz);
  double along_x = 0, along_z = 0;  // the steepest
  for (std::size_t k = 0; k < rows.size(); ++k)
    for (std::size_t i = 0; i < rows[k].size(); ++i) {
      field->values.push_back(float((2 * rows[k][i] - 1) * o.half.y));
      const auto rise = [&](double from) { return 2 * o.half.y * std::abs(rows[k][i] - from); };
      if (i > 0) along_x = std::max(along_x, rise(rows[k][i - 1]) / dx);
      if (k > 0) along_z = std::max(along_z, rise(rows[k - 1][i]) / dz);
    }
  o.trust = 1 / std::sqrt(1 + along_x * along_x + along_z * along_z);
  o.field = std::move(field);
}

Pose pose_at(const Obstacle& o, double time) {
  Obstacle::Key now{time, o.centre, o.rotation}, last{0, o.centre, o.rotation};
  for (const Obstacle::Key& key : o.keyframes) {
    if (time < key.time) {
      const double part = std::max(0.0, time - last.time) / (key.time - last.time);
      now.centre = glm::mix(last.centre, key.centre, part);
      now.rotation = glm::mix(last.rotation, key.rotation, part);
      break;
    }
    last = key, now.centre = key.centre, now.rotation = key.rotation;
  }
  return {now.centre + time * o.velocity, turn_by(time * o.spin) * rotation_of(now.rotation) * own_axes(o)};
}

Formulas<double>::Surface MovingShape::meeting(const glm::dvec3& x, const glm::dvec3& way) const {
  const glm::dmat3 back = glm::transpose(pose.axes);
  const glm::dvec3 to = back * (x - pose.centre);
  auto surface = Formulas<double>{texels}.meeting(solid, to - back * way, to);
  surface.normal = pose.axes * surface.normal;
  return surface;
}

Formulas<double>::Surface MovingShape::surface_at(const glm::dvec3& x) const {
  auto surface = Formulas<double>{texels}.surface_of(solid, glm::transpose(pose.axes) * (x - pose.centre));
  surface.normal = pose.axes * surface.normal;
  return surface;
}

double MovingShape::reach() const {
  if (solid.kind == SHAPE_PLANE || solid.kind == SHAPE_HEIGHTS) return std::numeric_limits<double>::infinity();
  const glm::dvec3 end = solid.origin + solid.spacing * glm::dvec3(solid.cells - 1);
  const glm::dvec3 field = glm::max(glm::abs(solid.origin), glm::abs(end));
  if (solid.kind == SHAPE_GRID) return glm::length(field);
  if (solid.kind == SHAPE_CYLINDER) return glm::length(glm::dvec2(solid.extent.y, solid.radius));
  return glm::length(solid.extent) + solid.radius;
}

MovingShape moving_shape(const Obstacle& o, double start, double h, double friction, double restitution) {
  MovingShape shape;
  auto& s = shape.solid;
  s.kind = o.shape, s.trust = o.trust, s.radius = o.radius;
  if (o.shape == SHAPE_CAPSULE || o.shape == SHAPE_CYLINDER) s.extent.y = o.half_length;
  if (o.shape == SHAPE_BOX || o.shape == SHAPE_HEIGHTS) s.extent = o.half;
  if (o.field) {
    shape.texels = o.field->values.data();
    s.spacing = o.field->spacing, s.origin = o.field->origin, s.cells = o.field->size;
  }
  const Pose before = pose_at(o, start);
  shape.pose = pose_at(o, start + h);
  if (moves(o) && h > 0) {
    shape.velocity = (shape.pose.centre - before.centre) / h;
    const glm::dquat turn = glm::quat_cast(shape.pose.axes * glm::transpose(before.axes));
    const glm::dvec3 axis(turn.x, turn.y, turn.z);
    const double sine = glm::length(axis);
    if (sine > 0) shape.spin = axis / sine * (2 * std::atan2(sine, turn.w) / h);
  }
  shape.friction = o.friction.value_or(friction), shape.restitution = o.restitution.value_or(restitution);
  return shape;
}

}  // namespace tetpbd
