#include "sim/contact/moving_obstacle.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "sim/model/settings.h"

namespace tetpbd {

namespace {

struct Order {
  std::vector<const Obstacle*> planes, solids;
};
// The ground's place among the planes stays free where there is no ground, so that switching it needs no other kernels.
Order order_obstacles(const Model& model) {
  Order order;
  for (const Obstacle& o : model.obstacles) {
    const bool plain = o.kind->flat && !moves(o) && !o.friction && !o.restitution;
    (plain && order.planes.size() + 1 < MAX_PLANES ? order.planes : order.solids).push_back(&o);
  }
  return order;
}

MovingObstacle plane_obstacle(const glm::dvec3& normal, double d) {
  MovingObstacle o;
  o.is_plane = true, o.plane = glm::dvec4(normal, d);
  o.reach = bound_reach({});
  return o;
}

}  // namespace

MovingObstacle::Surface MovingObstacle::find_surface(const glm::dvec3& x) const {
  Surface surface =
      Formulas<double>{texels, kind->distance}.surface_of(solid, glm::transpose(pose.axes) * (x - pose.centre));
  surface.normal = pose.axes * surface.normal;
  return surface;
}

MovingObstacle::Surface MovingObstacle::find_contact(const glm::dvec3& x, const glm::dvec3& displacement) const {
  const glm::dmat3 into = glm::transpose(pose.axes);
  const glm::dvec3 to = into * (x - pose.centre);
  Surface surface = Formulas<double>{texels, kind->distance}.find_contact(solid, to - into * displacement, to);
  surface.normal = pose.axes * surface.normal;
  return surface;
}

MovingObstacle moving_obstacle(const Obstacle& o, double start, double h) {
  MovingObstacle moving;
  moving.kind = o.kind, moving.solid = describe_solid(o), moving.reach = bound_reach(o);
  if (o.field) moving.texels = o.field->values.data();
  const Pose before = pose_at(o, start);
  moving.pose = pose_at(o, start + h);
  if (moves(o) && h > 0) {
    moving.velocity = (moving.pose.centre - before.centre) / h;
    const glm::dquat turn = glm::quat_cast(moving.pose.axes * glm::transpose(before.axes));
    const glm::dvec3 axis(turn.x, turn.y, turn.z);
    const double sine = glm::length(axis);
    if (sine > 0) moving.spin = axis / sine * (2 * std::atan2(sine, turn.w) / h);
  }
  moving.friction = o.friction, moving.restitution = o.restitution;
  return moving;
}

std::vector<MovingObstacle> obstacles_at(const Model& model, const Settings& settings, double start, double h) {
  const Order order = order_obstacles(model);
  std::vector<MovingObstacle> list;
  if (settings.ground) list.push_back(plane_obstacle({0, 1, 0}, settings.ground_height));
  for (const Obstacle* o : order.planes) {
    const glm::dvec3 normal = glm::normalize(o->normal);
    list.push_back(plane_obstacle(normal, glm::dot(normal, o->centre)));
  }
  for (const Obstacle* o : order.solids) list.push_back(moving_obstacle(*o, start, h));
  return list;
}

std::vector<const Obstacle*> solid_obstacles(const Model& model) { return order_obstacles(model).solids; }

bool has_obstacles(const Model& model, const Settings& settings) { return settings.ground || !model.obstacles.empty(); }

glm::dvec3 out_of_obstacles(const Model& model, const Settings& settings, double time, glm::dvec3 x) {
  for (const MovingObstacle& o : obstacles_at(model, settings, time)) {
    const auto surface = o.surface_at(x);
    x -= surface.normal * std::min(0.0, surface.distance);
  }
  return x;
}

}  // namespace tetpbd
