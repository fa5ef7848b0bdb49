// Contact of hard bodies on the CPU (method.md, "Contact of a hard body"): while a body touches, it moves as
// a rigid one. GPU modes: shaders/contact/rigid_contact.comp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sim/solvers/substep.h"

namespace tetpbd {

/// Whether hard bodies are carried: rigid_in_contact(), and there is something to touch. Beside a soft one
/// none is: a kernel would need more than 8 storage blocks for records and multipliers.
inline bool touches_rigidly(const Model& model, const Settings& settings) {
  const auto is_rigid = [&](const Body& body) { return rigid_in_contact(settings, body_material(body, settings)); };
  return has_obstacles(model, settings) && !any_material(model, settings, compliant) &&
         std::ranges::any_of(model.bodies, is_rigid);
}

class RigidContact {
 public:
  RigidContact(const Model& model, const Settings& settings)
      : model_(model),
        settings_(settings),
        wanted_(touches_rigidly(model, settings)),
        carried_(model.positions.size()) {}

  bool wanted() const { return wanted_; }  ///< else prepare() does nothing
  /// Whether vertex i belongs to a body that touches: then its velocity is the body's in the whole substep.
  bool carries(std::size_t i) const { return carried_[i]; }

  /// Where prediction moves vertex i from x; changes v if its body is free.
  glm::dvec3 predict(const Substep& s, std::size_t i, const glm::dvec3& x, glm::dvec3& v) const {
    return carried_[i] ? x + s.h * v : s.predict(x, v);
  }

  /// At the start of a substep: finds bodies that would touch an obstacle, and sets their
  /// velocities v. `place.at(i)`: of vertex i, m. Counts what was left out.
  template <class Place>
  void prepare(const Substep& s, const std::vector<double>& inverse_masses, const Place& place,
               std::vector<glm::dvec3>& v, GuardCounts& counts) {
    if (!wanted_) return;
    for (const Body& body : model_.bodies) {
      if (!body.one_piece || !rigid_in_contact(settings_, body_material(body, settings_))) continue;
      const std::size_t first = body.first_vertex, end = first + body.vertices;
      const auto near = near_contacts(s, inverse_masses, place, v, first, end);
      const bool moved = !near.empty() && move(s, near, place, v, first, end, counts);
      std::fill(carried_.begin() + std::ptrdiff_t(first), carried_.begin() + std::ptrdiff_t(end), moved);
    }
  }

 private:
  using Rules = Formulas<double>;

  // The vertices that would touch an obstacle next; none if one is fixed.
  template <class Place>
  std::vector<std::size_t> near_contacts(const Substep& s, const std::vector<double>& inverse_masses,
                                         const Place& place, const std::vector<glm::dvec3>& v, std::size_t first,
                                         std::size_t end) const {
    std::vector<std::size_t> found;
    for (std::size_t i = first; i < end; ++i) {
      if (!(inverse_masses[i] > 0)) return {};
      glm::dvec3 speed = v[i];
      const glm::dvec3 here = place.at(std::uint32_t(i)), next = s.predict(here, speed);
      const auto stops = [&](const MovingObstacle& o) {
        return o.surface_met(next, next - here - s.h * o.velocity_at(here)).distance < 0;
      };
      if (std::ranges::any_of(s.obstacles, stops)) found.push_back(i);
    }
    return found;
  }

  // False for a body without inertia about some axis.
  template <class Place>
  bool move(const Substep& s, const std::vector<std::size_t>& near, const Place& place, std::vector<glm::dvec3>& v,
            std::size_t first, std::size_t end, GuardCounts& counts) const {
    const auto at = [&](std::size_t i) { return place.at(std::uint32_t(i)); };
    double mass = 0;
    Rules::Rigid body{};
    for (std::size_t i = first; i < end; ++i) {
      const double m = model_.masses[i];
      mass += m, body.centre += m * at(i), body.velocity += m * v[i];
    }
    body.centre /= mass, body.velocity /= mass;
    glm::dvec3 angular(0);
    glm::dmat3 moments(0);
    for (std::size_t i = first; i < end; ++i) {
      const glm::dvec3 arm = at(i) - body.centre;
      angular += model_.masses[i] / mass * glm::cross(arm, v[i]);
      moments += model_.masses[i] / mass * glm::outerProduct(arm, arm);
    }
    body.inverse_inertia = Rules{}.inverse_inertia_of(moments);
    if (!Rules{}.has_inertia(body)) return false;
    body.spin = body.inverse_inertia * angular;
    const Rules::Rigid before = body;
    body.velocity = (body.velocity + s.h * s.gravity) * s.velocity_scale, body.spin *= s.velocity_scale;
    const double fall = s.h * glm::length(s.gravity), enough = 1e-9 * (fall + glm::length(body.velocity));
    const Rules::Rigid falling = body;
    // Contacts are taken in as the motion found so far breaks them, the worst first.
    Rules::Touch touches[MOST_TOUCHES], worst;
    std::array<std::size_t, MOST_TOUCHES + 1> places{};  // a number per vertex and obstacle
    for (int count = 0;; ++count) {
      const double loose = 1e-3 * fall + enough;
      double most = loose;
      std::size_t place = 0;
      // Of vertex i at arm: a normal and the gap there, how the obstacle moves, brakes and rebounds.
      const auto consider = [&](std::size_t i, const glm::dvec3& arm, const glm::dvec3& n, double gap,
                                const glm::dvec3& surface, const MovingObstacle& o) {
        const double least = Rules{}.least_velocity(glm::dot(n, Rules{}.velocity_at(before, arm) - surface),
                                                    gap - Rules{}.closed_gap * model_.size, s.h, fall, o.restitution);
        ++place;
        const double over = least - glm::dot(n, Rules{}.velocity_at(body, arm) - surface);
        if (!(over > most)) return;
        most = over, places[std::size_t(count)] = place,
        worst = Rules{}.touch_at(body, n, arm, least, glm::dvec3(0), surface, friction_on(o, model_, i));
      };
      for (const std::size_t i : near) {
        const glm::dvec3 arm = at(i) - body.centre;
        for (const MovingObstacle& o : s.obstacles) {
          const glm::dvec3 surface = o.velocity_at(at(i)), way = s.h * (Rules{}.velocity_at(falling, arm) - surface);
          const auto ahead = o.surface_ahead(at(i), s.h * surface + way, way);
          consider(i, arm, ahead.normal, ahead.distance, surface, o);
        }
      }
      const auto taken = places.begin() + count;
      if (most == loose || std::find(places.begin(), taken, *taken) != taken)
        break;  // where one is known contacts contradict each other, as where a body is jammed
      if (count == MOST_TOUCHES) {
        ++counts[GUARDS + DROP_CONTACTS];
        break;
      }
      touches[count] = worst;
      body = Rules{}.settled(touches, body, count + 1, enough, 1e-4 * fall);
    }
    counts[GUARDS + DROP_SWEEPS] += body.unsettled;
    for (std::size_t i = first; i < end; ++i) v[i] = Rules{}.velocity_at(body, at(i) - body.centre);
    return true;
  }

  const Model& model_;
  const Settings& settings_;
  bool wanted_;
  std::vector<char> carried_;
};

}  // namespace tetpbd
