#include "sim/reference/rigid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/rotation.h"

namespace tetpbd {

namespace {

glm::dvec3 angular_velocity(const RigidBody& b) {
  return b.rotation * (glm::inverse(b.inertia) * (glm::transpose(b.rotation) * b.angular));
}

glm::dmat3 rotate(const glm::dmat3& rotation, const glm::dvec3& angle) {
  const double size = glm::length(angle);
  if (size == 0) return rotation;
  return glm::mat3_cast(glm::normalize(glm::angleAxis(size, angle / size) * glm::quat_cast(rotation)));
}

// The explicit midpoint method; between contacts no torque acts.
void move(RigidBody& b, double h) {
  b.centre += h * b.velocity;
  const glm::dmat3 start = b.rotation;
  b.rotation = rotate(start, h / 2 * angular_velocity(b));
  const glm::dvec3 spin = angular_velocity(b);
  b.rotation = rotate(start, h * spin);
  b.moved += h * (glm::length(b.velocity) + glm::length(spin) * b.radius);
}

// Of a body's many vertices, few come near an obstacle within many steps, so these are found anew only now and then.
void find_near(RigidBody& b, const std::vector<MovingObstacle>& obstacles, bool moving) {
  if (b.moved <= 0.9 * b.reach && !moving) return;
  b.near.clear(), b.reach = 0.01 * b.radius, b.moved = 0;
  for (std::uint32_t i = 0; i < b.rest.size(); ++i) {
    const glm::dvec3 x = b.centre + b.rotation * b.rest[i];
    const auto is_near = [&](const MovingObstacle& o) { return o.surface_at(x).distance < b.reach; };
    if (std::ranges::any_of(obstacles, is_near)) b.near.push_back(i);
  }
}

/// A vertex that touches an obstacle.
struct ContactPoint {
  std::size_t number;   ///< obstacle * vertices of the body + vertex
  glm::dvec3 arm;       ///< m, from the centre
  glm::dmat3 axes;      ///< columns: normal, two tangents
  glm::dmat3 response;  ///< 1/kg, the change of the point's velocity by an impulse there, in those axes
  double scale;         ///< kg, of the iteration: 1 over a bound of `response`
  double approach;      ///< m/s, normal velocity before
  glm::dvec3 surface;   ///< m/s, velocity of the obstacle there
  double friction, restitution;
  glm::dvec3 impulse{0};  ///< N s, in those axes
};

std::vector<ContactPoint> find_contacts(const RigidBody& b, const std::vector<MovingObstacle>& obstacles,
                                        const glm::dmat3& inverse, const Settings& settings) {
  std::vector<ContactPoint> found;
  const glm::dvec3 spin = angular_velocity(b);
  for (std::size_t k = 0; k < obstacles.size(); ++k)
    for (const std::uint32_t i : b.near) {
      const MovingObstacle& o = obstacles[k];
      const glm::dvec3 arm = b.rotation * b.rest[i];
      const auto [n, distance] = o.surface_at(b.centre + arm);
      if (!(distance <= 0)) continue;
      const glm::dvec3 side = std::abs(n.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
      const glm::dvec3 t = glm::normalize(glm::cross(n, side));
      ContactPoint c;
      c.number = k * b.rest.size() + i, c.arm = arm, c.surface = o.velocity_at(b.centre + arm);
      c.friction = friction_on(o, settings, b.number), c.restitution = restitution_on(o, settings, b.number);
      c.axes = glm::dmat3(n, t, glm::cross(n, t));
      const glm::dmat3 cross(glm::cross(arm, c.axes[0]), glm::cross(arm, c.axes[1]), glm::cross(arm, c.axes[2]));
      c.response = glm::dmat3(1 / b.mass) + glm::transpose(cross) * inverse * cross;
      c.scale = 1 / (c.response[0][0] + c.response[1][1] + c.response[2][2]);
      c.approach = glm::dot(n, b.velocity + glm::cross(spin, arm) - c.surface);
      found.push_back(c);
    }
  return found;
}

// The impulse in Coulomb's cone that is nearest to p.
glm::dvec3 project_to_cone(const glm::dvec3& p, double friction) {
  const double slip = std::hypot(p.y, p.z);
  if (slip <= friction * p.x) return p;
  if (friction * slip <= -p.x) return glm::dvec3(0);
  const double normal = (p.x + friction * slip) / (1 + friction * friction);
  return {normal, p.y * friction * normal / slip, p.z * friction * normal / slip};
}

// Whether fixed vertices hold the body. Throws Error where it can turn about them.
bool is_held(const Model& model, const Body& body) {
  std::vector<glm::dvec3> fixed;
  for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i)
    if (model.inverse_masses[i] == 0) fixed.push_back(model.positions[i]);
  if (fixed.empty()) return false;
  const auto from_first = [&](const glm::dvec3& p) { return glm::length(p - fixed[0]); };
  const glm::dvec3 far = *std::ranges::max_element(fixed, {}, from_first) - fixed[0];
  for (const glm::dvec3& p : fixed)
    if (glm::length(glm::cross(p - fixed[0], far)) > 1e-6 * model.size * model.size) return true;
  throw Error("a rigid body is free, or held", fmt::format("{} can turn about its fixed vertices", body.name),
              "free them, or fix three that are not on a line");
}

}  // namespace

std::vector<RigidBody> rigid_bodies(const Model& model) {
  std::vector<RigidBody> bodies;
  for (const Body& body : model.bodies) {
    RigidBody b;
    b.first = body.first_vertex, b.held = is_held(model, body), b.number = body.number;
    glm::dvec3 rest_centre(0), momentum(0);
    const auto each = [&](auto&& visit) {
      for (std::size_t i = b.first; i < b.first + body.vertices; ++i) visit(i, model.masses[i]);
    };
    each([&](std::size_t i, double m) {
      b.mass += m;
      b.centre += m * model.positions[i];
      rest_centre += m * model.rest.positions[i];
      momentum += m * model.velocities[i];
    });
    b.centre /= b.mass, rest_centre /= b.mass, b.velocity = momentum / b.mass;
    glm::dmat3 covariance(0);
    each([&](std::size_t i, double m) {
      const glm::dvec3 r = model.rest.positions[i] - rest_centre, x = model.positions[i] - b.centre;
      b.rest.push_back(r);
      b.radius = std::max(b.radius, glm::length(r));
      b.inertia += m * (glm::dmat3(glm::dot(r, r)) - glm::outerProduct(r, r));
      covariance += m * glm::outerProduct(x, r);
      b.angular += m * glm::cross(x, model.velocities[i]);
    });
    b.rotation = best_rotation(covariance).R;
    if (b.held) b.velocity = b.angular = glm::dvec3(0);
    const glm::dvec3 spin = angular_velocity(b);
    each([&](std::size_t i, double) {
      const glm::dvec3 arm = b.rotation * b.rest[i - b.first];
      const double apart = glm::length(b.centre + arm - model.positions[i]),
                   slip = glm::length(b.velocity + glm::cross(spin, arm) - model.velocities[i]);
      if (apart > 1e-6 * model.size || slip > 1e-6 * (glm::length(b.velocity) + glm::length(spin) * model.size))
        throw Error("no rigid body", fmt::format("{} starts deformed, or deforming", body.name),
                    "k = 1 has a reference motion from the rest shape only");
    });
    bodies.push_back(b);
  }
  return bodies;
}

void advance(RigidBody& b, const Model& model, const Settings& settings, double h) {
  if (b.held) return;
  move(b, h / 2);
  const glm::dmat3 inverse = b.rotation * glm::inverse(b.inertia) * glm::transpose(b.rotation);
  const std::vector<MovingObstacle> obstacles = obstacles_at(model, settings, b.time, h);
  b.time += h;
  find_near(b, obstacles, std::ranges::any_of(model.obstacles, moves));
  std::vector<ContactPoint> contacts = find_contacts(b, obstacles, inverse, settings);
  b.velocity.y -= h * settings.gravity;
  glm::dvec3 spin = angular_velocity(b);
  const auto apply = [&](const ContactPoint& c, const glm::dvec3& impulse) {
    const glm::dvec3 in_world = c.axes * impulse;
    b.velocity += in_world / b.mass;
    spin += inverse * glm::cross(c.arm, in_world);
  };
  // Impulses start from those of the last step, which are nearly those of a body that lies.
  for (ContactPoint& c : contacts) {
    const auto last = std::ranges::lower_bound(b.impulses, c.number, {}, [](const auto& one) { return one.first; });
    if (last != b.impulses.end() && last->first == c.number) apply(c, c.impulse = last->second);
  }
  // Each contact's impulse is found in turn with the others as they are (de Saxce and Feng 1998: a step against the
  // velocity, opened by the slip, and a projection to the cone), until the body's motion changes no more. That settles
  // long before the impulses that the contacts of a flat side share among them.
  constexpr int most_sweeps = 100000;
  const double enough = 1e-13 * (std::abs(settings.gravity) * h + glm::length(b.velocity));
  double change = contacts.empty() ? 0 : 1 + enough;
  for (int sweep = 0; sweep < most_sweeps && change > enough; ++sweep) {
    const glm::dvec3 velocity = b.velocity, turning = spin;
    for (ContactPoint& c : contacts) {
      glm::dvec3 u = glm::transpose(c.axes) * (b.velocity + glm::cross(spin, c.arm) - c.surface);
      u.x += c.restitution * std::min(c.approach, 0.0);
      const glm::dvec3 before = c.impulse;
      for (int local = 0; local < 4; ++local) {
        const glm::dvec3 now = u + c.response * (c.impulse - before);
        const glm::dvec3 against(now.x + c.friction * std::hypot(now.y, now.z), now.y, now.z);
        c.impulse = project_to_cone(c.impulse - c.scale * against, c.friction);
      }
      apply(c, c.impulse - before);
    }
    change = glm::length(b.velocity - velocity) + b.radius * glm::length(spin - turning);
  }
  b.impulses.clear();
  for (const ContactPoint& c : contacts) {
    b.angular += glm::cross(c.arm, c.axes * c.impulse);
    b.impulses.emplace_back(c.number, c.impulse);
  }
  move(b, h / 2);
}

State make_state(const Model& model, const std::vector<RigidBody>& bodies) {
  State state{model.positions, model.velocities};
  for (const RigidBody& b : bodies) {
    const glm::dvec3 spin = angular_velocity(b);
    for (std::size_t i = 0; i < b.rest.size(); ++i) {
      const glm::dvec3 arm = b.rotation * b.rest[i];
      state.positions[b.first + i] = b.centre + arm;
      state.velocities[b.first + i] = b.velocity + glm::cross(spin, arm);
    }
  }
  return state;
}

}  // namespace tetpbd
