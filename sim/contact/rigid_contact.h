// Hard bodies on the CPU (method.md, "Hard bodies are rigid"): a body in contact, or not deformed, moves as a rigid
// one. GPU modes: shaders/contact/rigid_contact.comp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sim/model/attachments.h"
#include "sim/solvers/substep.h"

namespace tetpbd {

class RigidContact {
 public:
  /// The largest strain of an edge in a body that is not deformed.
  static constexpr double most_strain = 1e-3;
  /// Of a mean edge: the correction of a vertex, averaged over its constraints, that such a strain makes.
  static constexpr double slack = 0.2 * most_strain;

  /// A system without lists is that of bodies which keep their shape anyway.
  RigidContact(const Model& model, const ConstraintSystem& system)
      : model_(&model),
        edges_(system.lists.empty() ? ConstraintList{} : system.lists[std::size_t(index_of<Stretch>)]),
        loose_(loose_pieces(model, system)),
        motions_(std::max<std::size_t>(model.bodies.size(), 1)),
        body_of_(model.positions.size()) {
    for (std::size_t b = 0; b < model.bodies.size(); ++b) {
      const Body& body = model.bodies[b];
      std::fill_n(body_of_.begin() + std::ptrdiff_t(body.first_vertex), body.vertices, std::uint32_t(b));
    }
    for (std::size_t c = 0; c < edges_.count(); ++c) ++motions_[body_of_[edges_.ends(c)[0]]].edges;
    for (std::size_t b = 1; b < motions_.size(); ++b)
      motions_[b].first_edge = motions_[b - 1].first_edge + motions_[b - 1].edges;
  }

  /// Begins a step. The model and the settings have to live longer than it.
  void begin(const Model& model, const Settings& settings) {
    model_ = &model, settings_ = &settings, wanted_ = any_moves_rigidly(settings);
    for (Motion& motion : motions_) motion.is = Motion::free;
  }
  bool wanted() const { return wanted_; }  ///< else prepare() does nothing
  /// Whether vertex i has the velocity of a rigid body for the whole substep, in contact or at all.
  bool touches(std::size_t i) const { return motions_[body_of_[i]].is == Motion::touching; }
  bool carries(std::size_t i) const { return motions_[body_of_[i]].is != Motion::free; }
  /// By body, whether it has; empty if no body ever does.
  std::vector<char> carried() const {
    std::vector<char> result;
    for (std::size_t b = 0; b < motions_.size() && wanted_; ++b) result.push_back(motions_[b].is != Motion::free);
    return result;
  }

  /// The position to which prediction moves vertex i from x; changes v if its body is free.
  glm::dvec3 predict(const Substep& s, std::size_t i, const glm::dvec3& x, glm::dvec3& v) const {
    const Motion& motion = motions_[body_of_[i]];
    if (motion.is == Motion::free) return s.predict(i, x, v);
    if (motion.is == Motion::touching) return x + s.h * v;
    return x + s.h * motion.velocity + Rules{}.moved_by_turn(motion.turn, x - motion.centre);
  }
  /// The velocity of vertex i, predicted with v, once constraints and obstacles have moved it from there to x.
  glm::dvec3 velocity_after(const Substep& s, std::size_t i, const glm::dvec3& x, const glm::dvec3& predicted,
                            const glm::dvec3& v) const {
    const Motion& motion = motions_[body_of_[i]];
    if (motion.is == Motion::free) return v + (x - predicted) / s.h;
    if (motion.is == Motion::touching) return v;
    return motion.velocity + glm::cross(motion.spin, x - motion.centre - s.h * motion.velocity);
  }

  /// At the start of a substep: finds the bodies that move as rigid ones, and sets the velocities v of those in
  /// contact. `place.at(i)` is the position of vertex i, m; `counts` counts contacts left out and sweeps that did not
  /// converge; what obstacles that move do on a body is added to the `work` of its first vertex, if there is any.
  /// `wrenches`: by body, with what pairs did to it in the substep before it begins this one; or empty.
  template <class Place>
  void prepare(const Substep& s, const std::vector<double>& inverse_masses, const Place& place,
               std::vector<glm::dvec3>& v, std::vector<double>& work, GuardCounts& counts,
               const std::vector<Wrench>& wrenches = {}) {
    for (std::size_t b = 0; b < model_->bodies.size() && wanted_; ++b) {
      const Body& body = model_->bodies[b];
      Motion& motion = motions_[b];
      motion.is = Motion::free;
      if (!loose_[b] || !moves_rigidly(*settings_, material_of(*settings_, body.number))) continue;
      const std::size_t first = body.first_vertex, end = first + body.vertices;
      const auto is_fixed = [](double inverse_mass) { return !(inverse_mass > 0); };
      if (std::any_of(&inverse_masses[first], &inverse_masses[first] + body.vertices, is_fixed)) continue;
      const auto near = near_contacts(s, place, v, first, end);
      const bool touches = !near.empty();
      const Wrench given = wrenches.empty() ? Wrench{} : wrenches[b];
      if (touches && move(s, near, place, v, given, work.empty() ? nullptr : &work[first], body, counts))
        motion.is = Motion::touching;
      else if (!touches && keeps_shape(motion, place) && fly(s, place, v, given, motion, first, end))
        motion.is = Motion::flying;
    }
  }

  /// The mean motion of vertices from `first` to `end`; has_inertia() is false if they have none about some axis.
  template <class Place>
  static Formulas<double>::Rigid mean_motion(const Model& model, const Place& place, const std::vector<glm::dvec3>& v,
                                             std::size_t first, std::size_t end) {
    double mass = 0;
    Formulas<double>::Rigid body{};
    for (std::size_t i = first; i < end; ++i) {
      const double m = model.masses[i];
      mass += m, body.centre += m * place.at(std::uint32_t(i)), body.velocity += m * v[i];
    }
    body.centre /= mass, body.velocity /= mass;
    glm::dvec3 angular(0);
    glm::dmat3 moments(0);
    for (std::size_t i = first; i < end; ++i) {
      const glm::dvec3 arm = place.at(std::uint32_t(i)) - body.centre;
      angular += model.masses[i] / mass * glm::cross(arm, v[i]);
      moments += model.masses[i] / mass * glm::outerProduct(arm, arm);
    }
    body.inverse_inertia = Formulas<double>{}.inverse_inertia_of(moments);
    body.spin = body.inverse_inertia * angular;
    return body;
  }

 private:
  using Rules = Formulas<double>;

  // How a body moves in a substep.
  struct Motion {
    std::size_t first_edge = 0, edges = 0;
    enum { free, touching, flying } is = free;
    glm::dvec3 centre{0}, velocity{0}, turn{0};  // in flight: at its start, the turn as in turn_in_flight
    glm::dvec3 spin{0};                          // in flight, at its end
  };

  // The vertices that would be in an obstacle after the substep.
  template <class Place>
  std::vector<std::size_t> near_contacts(const Substep& s, const Place& place, const std::vector<glm::dvec3>& v,
                                         std::size_t first, std::size_t end) const {
    std::vector<std::size_t> found;
    for (std::size_t i = first; i < end && !s.obstacles.empty(); ++i) {
      glm::dvec3 velocity = v[i];
      const glm::dvec3 here = place.at(std::uint32_t(i)), next = s.predict(i, here, velocity);
      const auto stops = [&](const MovingObstacle& o) {
        return o.surface_met(next, next - here - s.h * o.velocity_at(here)).distance < 0;
      };
      if (std::ranges::any_of(s.obstacles, stops)) found.push_back(i);
    }
    return found;
  }

  template <class Place>
  bool keeps_shape(const Motion& motion, const Place& place) const {
    for (std::size_t c = motion.first_edge; c < motion.first_edge + motion.edges; ++c) {
      const auto ends = edges_.ends(c);
      const glm::dvec3 d = place.at(ends[1]) - place.at(ends[0]);
      const double squared = edges_.rest[c] * edges_.rest[c];
      if (!(std::abs(glm::dot(d, d) - squared) <= 2 * most_strain * squared)) return false;
    }
    return true;
  }

  // Finds how the body moves in flight; false if it has no inertia about some axis.
  template <class Place>
  bool fly(const Substep& s, const Place& place, const std::vector<glm::dvec3>& v, const Wrench& given, Motion& motion,
           std::size_t first, std::size_t end) const {
    Rules::Rigid body = mean_motion(*model_, place, v, first, end);
    if (!Rules{}.has_inertia(body)) return false;
    give(given, s, body);
    motion.centre = body.centre;
    motion.velocity = (body.velocity + s.h * s.gravity) * s.velocity_scale;
    const glm::dvec3 angular = glm::inverse(body.inverse_inertia) * body.spin * s.velocity_scale;
    motion.turn = Rules{}.turn_in_flight(body.inverse_inertia, angular, s.h);
    const glm::dvec3 spin = body.inverse_inertia * (angular + Rules{}.moved_by_turn(-motion.turn, angular));
    motion.spin = spin + Rules{}.moved_by_turn(motion.turn, spin);
    return true;
  }

  static void give(const Wrench& given, const Substep& s, Rules::Rigid& body) {
    body.velocity += given.impulse / s.h;
    const glm::dvec3 turning = given.turning + glm::cross(given.about - body.centre, given.impulse);
    body.spin += body.inverse_inertia * turning / s.h;
  }

  // Sets the velocities of a body in contact; false if it has no inertia about some axis.
  template <class Place>
  bool move(const Substep& s, const std::vector<std::size_t>& near, const Place& place, std::vector<glm::dvec3>& v,
            const Wrench& given, double* work, const Body& own, GuardCounts& counts) const {
    const std::size_t first = own.first_vertex, end = first + own.vertices;
    const auto at = [&](std::size_t i) { return place.at(std::uint32_t(i)); };
    const Rules::Rigid before = mean_motion(*model_, place, v, first, end);
    if (!Rules{}.has_inertia(before)) return false;
    Rules::Rigid body = before;
    body.velocity = (body.velocity + s.h * s.gravity) * s.velocity_scale, body.spin *= s.velocity_scale;
    give(given, s, body);
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
                                                      gap - Rules{}.closed_gap * model_->size, s.h, fall,
                                                      restitution_on(o, *settings_, own.number));
          ++number;
          const double over = least - glm::dot(n, Rules{}.velocity_at(body, arm) - surface);
          if (!(over > most)) continue;
          most = over, numbers[std::size_t(count)] = number;
          worst = Rules{}.touch_at(body, n, arm, least, glm::dvec3(0), surface, friction_on(o, *settings_, own.number));
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
      for (int k = 0; k < touching; ++k) *work += model_->masses[i] * glm::dot(touches[k].impulse, touches[k].surface);
    counts[GUARDS + DROP_SWEEPS] += body.unsettled;
    for (std::size_t i = first; i < end; ++i) v[i] = Rules{}.velocity_at(body, at(i) - body.centre);
    return true;
  }

  const Model* model_;
  const Settings* settings_ = nullptr;
  bool wanted_ = false;
  ConstraintList edges_;
  std::vector<char> loose_;
  std::vector<Motion> motions_;         // by body
  std::vector<std::uint32_t> body_of_;  // by vertex
};

}  // namespace tetpbd
