// Contact of hard bodies on the CPU (method.md, "Contact of a hard body"): a body in contact moves as a rigid one. GPU
// modes: shaders/contact/rigid_contact.comp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sim/solvers/substep.h"

namespace tetpbd {

/// Whether hard bodies move as rigid ones: if rigid_in_contact(), and there are obstacles. No body does if any is soft,
/// because a kernel would need more than 8 storage blocks for records and multipliers.
inline bool touches_rigidly(const Model& model, const Settings& settings) {
  const auto is_rigid = [&](const Body& body) { return rigid_in_contact(settings, body_material(body, settings)); };
  return has_obstacles(model, settings) && !any_material(model, settings, compliant) &&
         std::ranges::any_of(model.bodies, is_rigid);
}

class RigidContact {
 public:
  RigidContact(const Model& model, const Settings& settings)
      : model_(model), settings_(settings), wanted_(touches_rigidly(model, settings)), moved_(model.positions.size()) {}

  bool wanted() const { return wanted_; }  ///< else prepare() does nothing
  /// Whether vertex i has the velocity of a rigid body in contact for the whole substep.
  bool carries(std::size_t i) const { return moved_[i]; }

  /// The position to which prediction moves vertex i from x; changes v if its body is free.
  glm::dvec3 predict(const Substep& s, std::size_t i, const glm::dvec3& x, glm::dvec3& v) const {
    return moved_[i] ? x + s.h * v : s.predict(x, v);
  }

  /// At the start of a substep: finds the bodies that would get into an obstacle, and sets their velocities v.
  /// `place.at(i)` is the position of vertex i, m; `counts` counts contacts left out and sweeps that did not converge;
  /// what obstacles that move do on a body is added to the `work` of its first vertex, if there is any.
  template <class Place>
  void prepare(const Substep& s, const std::vector<double>& inverse_masses, const Place& place,
               std::vector<glm::dvec3>& v, std::vector<double>& work, GuardCounts& counts) {
    if (!wanted_) return;
    for (const Body& body : model_.bodies) {
      if (!body.one_piece || !rigid_in_contact(settings_, body_material(body, settings_))) continue;
      const std::size_t first = body.first_vertex, end = first + body.vertices;
      const auto near = near_contacts(s, inverse_masses, place, v, first, end);
      const bool moved = !near.empty() && move(s, near, place, v, work.empty() ? nullptr : &work[first], body, counts);
      std::fill(moved_.begin() + std::ptrdiff_t(first), moved_.begin() + std::ptrdiff_t(end), moved);
    }
  }

 private:
  using Rules = Formulas<double>;

  // The vertices that would be in an obstacle after the substep; none if one is fixed.
  template <class Place>
  std::vector<std::size_t> near_contacts(const Substep& s, const std::vector<double>& inverse_masses,
                                         const Place& place, const std::vector<glm::dvec3>& v, std::size_t first,
                                         std::size_t end) const {
    std::vector<std::size_t> found;
    for (std::size_t i = first; i < end; ++i) {
      if (!(inverse_masses[i] > 0)) return {};
      glm::dvec3 velocity = v[i];
      const glm::dvec3 here = place.at(std::uint32_t(i)), next = s.predict(here, velocity);
      const auto stops = [&](const MovingObstacle& o) {
        return o.surface_met(next, next - here - s.h * o.velocity_at(here)).distance < 0;
      };
      if (std::ranges::any_of(s.obstacles, stops)) found.push_back(i);
    }
    return found;
  }

  // The mean motion of vertices from `first` to `end`; has_inertia() is false if they have none about some axis.
  template <class Place>
  Rules::Rigid rigid_motion(const Place& place, const std::vector<glm::dvec3>& v, std::size_t first,
                            std::size_t end) const {
    double mass = 0;
    Rules::Rigid body{};
    for (std::size_t i = first; i < end; ++i) {
      const double m = model_.masses[i];
      mass += m, body.centre += m * place.at(std::uint32_t(i)), body.velocity += m * v[i];
    }
    body.centre /= mass, body.velocity /= mass;
    glm::dvec3 angular(0);
    glm::dmat3 moments(0);
    for (std::size_t i = first; i < end; ++i) {
      const glm::dvec3 arm = place.at(std::uint32_t(i)) - body.centre;
      angular += model_.masses[i] / mass * glm::cross(arm, v[i]);
      moments += model_.masses[i] / mass * glm::outerProduct(arm, arm);
    }
    body.inverse_inertia = Rules{}.inverse_inertia_of(moments);
    body.spin = body.inverse_inertia * angular;
    return body;
  }

  // Sets the velocities of a body in contact; false if it has no inertia about some axis.
  template <class Place>
  bool move(const Substep& s, const std::vector<std::size_t>& near, const Place& place, std::vector<glm::dvec3>& v,
            double* work, const Body& own, GuardCounts& counts) const {
    const std::size_t first = own.first_vertex, end = first + own.vertices;
    const auto at = [&](std::size_t i) { return place.at(std::uint32_t(i)); };
    const Rules::Rigid before = rigid_motion(place, v, first, end);
    if (!Rules{}.has_inertia(before)) return false;
    Rules::Rigid body = before;
    body.velocity = (body.velocity + s.h * s.gravity) * s.velocity_scale, body.spin *= s.velocity_scale;
    const double fall = s.h * glm::length(s.gravity), enough = 1e-9 * (fall + glm::length(body.velocity)),
                 loose = 1e-3 * fall + enough;
    const Rules::Rigid falling = body;
    // Adds the worst contact as long as the motion violates any by more than `loose`, m/s.
    Rules::Touch touches[MOST_TOUCHES], worst;
    int touching = 0;
    std::array<std::size_t, MOST_TOUCHES + 1> numbers{};  // of the contacts, by vertex and obstacle
    for (int count = 0;; ++count) {
      double most = loose;
      std::size_t number = 0;
      for (const std::size_t i : near) {
        const glm::dvec3 arm = at(i) - body.centre;
        for (const MovingObstacle& o : s.obstacles) {
          const glm::dvec3 surface = o.velocity_at(at(i)),
                           displacement = s.h * (Rules{}.velocity_at(falling, arm) - surface);
          const auto [n, gap] = o.surface_ahead(at(i), s.h * surface + displacement, displacement);
          const double least = Rules{}.least_velocity(glm::dot(n, Rules{}.velocity_at(before, arm) - surface),
                                                      gap - Rules{}.closed_gap * model_.size, s.h, fall, o.restitution);
          ++number;
          const double over = least - glm::dot(n, Rules{}.velocity_at(body, arm) - surface);
          if (!(over > most)) continue;
          most = over, numbers[std::size_t(count)] = number;
          worst = Rules{}.touch_at(body, n, arm, least, glm::dvec3(0), surface, friction_on(o, model_, i));
        }
      }
      const auto added = numbers.begin() + count;
      // A known contact means that contacts contradict each other, as those of a jammed body.
      if (most == loose || std::find(numbers.begin(), added, *added) != added) break;
      if (count == MOST_TOUCHES) {
        ++counts[GUARDS + DROP_CONTACTS];
        break;
      }
      touches[count] = worst;
      touching = count + 1;
      body = Rules{}.settled(touches, body, touching, enough, 1e-4 * fall);
    }
    for (std::size_t i = first; i < end && work; ++i)
      for (int k = 0; k < touching; ++k) *work += model_.masses[i] * glm::dot(touches[k].impulse, touches[k].surface);
    counts[GUARDS + DROP_SWEEPS] += body.unsettled;
    for (std::size_t i = first; i < end; ++i) v[i] = Rules{}.velocity_at(body, at(i) - body.centre);
    return true;
  }

  const Model& model_;
  const Settings& settings_;
  bool wanted_;
  std::vector<char> moved_;  // by vertex
};

}  // namespace tetpbd
