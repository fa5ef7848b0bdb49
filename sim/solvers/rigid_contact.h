// Contact of hard bodies on the CPU (method.md, "Contact of a hard body"): while a body touches, it moves as
// a rigid one. GPU modes: shaders/rigid_contact.comp.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/solvers/substep.h"

namespace tetpbd {

/// Whether hard bodies are carried: rigid_in_contact(), and there is something to touch.
inline bool touches_rigidly(const Model& model, const Settings& settings) {
  return rigid_in_contact(settings) && !planes_of(model, settings).empty();
}

class RigidContact {
 public:
  RigidContact(const Model& model, const Settings& settings)
      : model_(model),
        wanted_(touches_rigidly(model, settings)),
        restitution_(settings.restitution),
        carried_(model.positions.size()) {}

  bool wanted() const { return wanted_; }  ///< else prepare() does nothing
  /// Whether vertex i belongs to a body that touches: then its velocity is the body's in the whole substep.
  bool carries(std::size_t i) const { return carried_[i]; }

  /// Where prediction moves vertex i from x; changes v if its body is free.
  glm::dvec3 predict(const Substep& s, std::size_t i, const glm::dvec3& x, glm::dvec3& v) const {
    return carried_[i] ? x + s.h * v : s.predict(x, v);
  }

  /// At a substep's start: finds bodies that would get into a half space, and sets their velocities v.
  /// `place.at(i)`: of vertex i, m.
  template <class Place>
  void prepare(const Substep& s, const std::vector<double>& inverse_masses, const Place& place,
               std::vector<glm::dvec3>& v) {
    if (!wanted_) return;
    for (const Body& body : model_.bodies) {
      if (!body.one_piece) continue;
      const std::size_t first = body.first_vertex, end = first + body.vertices;
      const auto near = near_contacts(s, inverse_masses, place, v, first, end);
      const bool moved = !near.empty() && move(s, near, place, v, first, end);
      std::fill(carried_.begin() + std::ptrdiff_t(first), carried_.begin() + std::ptrdiff_t(end), moved);
    }
  }

 private:
  using Rules = Formulas<double>;

  // The vertices that would be in a half space next; none if one is fixed.
  template <class Place>
  std::vector<std::size_t> near_contacts(const Substep& s, const std::vector<double>& inverse_masses,
                                         const Place& place, const std::vector<glm::dvec3>& v,
                                         std::size_t first, std::size_t end) const {
    std::vector<std::size_t> found;
    for (std::size_t i = first; i < end; ++i) {
      if (!(inverse_masses[i] > 0)) return {};
      glm::dvec3 speed = v[i];
      const glm::dvec3 next = s.predict(place.at(std::uint32_t(i)), speed);
      if (std::ranges::any_of(s.planes,
                              [&](const glm::dvec4& p) { return glm::dot(glm::dvec3(p), next) < p.w; }))
        found.push_back(i);
    }
    return found;
  }

  // False for a body without inertia about some axis.
  template <class Place>
  bool move(const Substep& s, const std::vector<std::size_t>& near, const Place& place,
            std::vector<glm::dvec3>& v, std::size_t first, std::size_t end) const {
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
    // Contacts are taken in as the motion found so far breaks them, the worst first.
    Rules::Touch touches[MOST_TOUCHES], worst;
    for (int count = 0; count < MOST_TOUCHES; ++count) {
      const double loose = 1e-3 * fall + enough;
      double most = loose;
      for (const std::size_t i : near)
        for (const glm::dvec4& plane : s.planes) {
          const glm::dvec3 n(plane), arm = at(i) - body.centre;
          const double least = Rules{}.least_velocity(
              glm::dot(n, Rules{}.velocity_at(before, arm)),
              glm::dot(n, at(i)) - plane.w - Rules{}.closed_gap * model_.size, s.h, fall, restitution_);
          const double over = least - glm::dot(n, Rules{}.velocity_at(body, arm));
          if (over > most) most = over, worst = Rules{}.touch_at(body, n, arm, least, glm::dvec3(0));
        }
      if (most == loose) break;
      touches[count] = worst;
      body = Rules{}.settled(touches, body, count + 1, s.friction, enough, 1e-4 * fall);
    }
    for (std::size_t i = first; i < end; ++i) v[i] = Rules{}.velocity_at(body, at(i) - body.centre);
    return true;
  }

  const Model& model_;
  bool wanted_;
  double restitution_;
  std::vector<char> carried_;
};

}  // namespace tetpbd
