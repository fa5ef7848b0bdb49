#include "sim/contact/obstacle.h"

#include <algorithm>
#include <cmath>

#include "sim/contact/obstacle_kinds.h"

namespace tetpbd {

std::vector<double> obstacle_values(const Obstacle& o) {
  std::vector<double> all = {double(o.kind->number()), o.radius, o.half_length, o.friction.value_or(-1),
                             o.restitution.value_or(-1)};
  const auto add = [&](const glm::dvec3& v) { all.insert(all.end(), {v.x, v.y, v.z}); };
  for (const glm::dvec3& v : {o.centre, o.normal, o.rotation, o.half, o.velocity, o.spin}) add(v);
  for (const Obstacle::Key& key : o.keyframes) all.push_back(key.time), add(key.centre), add(key.rotation);
  if (o.field) add(o.field->origin), all.push_back(o.field->spacing);
  return all;
}

namespace {

// The axes before rotation; a half space has its normal as y.
glm::dmat3 unrotated_axes(const Obstacle& o) {
  if (!o.kind->flat) return glm::dmat3(1);
  const glm::dvec3 up = glm::normalize(o.normal);
  const glm::dvec3 side = std::abs(up.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  const glm::dvec3 right = glm::normalize(glm::cross(up, side));
  return {right, up, glm::cross(right, up)};
}

}  // namespace

void set_heights(Obstacle& o, const std::vector<std::vector<double>>& rows) {
  auto field = std::make_shared<DistanceField>();
  field->size = {int(rows[0].size()), 1, int(rows.size())};
  const double dx = 2 * o.half.x / (field->size.x - 1), dz = 2 * o.half.z / (field->size.z - 1);
  field->spacing = std::min(dx, dz);
  double along_x = 0, along_z = 0;  // largest slopes
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
  const Pose turned = pose_at(static_cast<const Path&>(o), time);
  return {turned.centre, turned.axes * unrotated_axes(o)};
}

}  // namespace tetpbd
