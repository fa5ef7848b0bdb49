// Pairs of surfaces of which a side is a hard body that moves as a rigid one (method.md, "Hard bodies in contact"). GPU
// modes: shaders/contact/bodies/hard.comp.
#include <algorithm>

#include "sim/contact/offset_contact.h"
#include "sim/contact/rigid_contact.h"

namespace tetpbd {

namespace {

using Formula = Formulas<double>;

double sign_of(std::size_t side) { return side == 0 ? 1 : -1; }

// The body's motion where the substep began.
HardBody make_hard_body(const Model& model, const Body& body, const std::vector<glm::dvec3>& x,
                        const std::vector<glm::dvec3>& v, double h) {
  const Formula::Rigid motion =
      RigidContact::mean_motion(model, x, v, body.first_vertex, body.first_vertex + body.vertices);
  const double inverse_mass = 1 / body_mass(model, body);
  return {.moves = true,
          .inverse_mass = inverse_mass,
          .centre = motion.centre,
          .inverse_inertia = motion.inverse_inertia * inverse_mass,
          .way = h * motion.velocity,
          .turn = h * motion.spin};
}

}  // namespace

void OffsetContact::find_hard_bodies(const Substep& substep, std::span<const char> rigid) {
  wrenches_.clear();
  if (std::ranges::none_of(rigid, [](char is) { return is != 0; })) return hard_.clear();
  hard_.assign(rigid.size(), {});
  body_of_.resize(start_.size());
  for (std::size_t b = 0; b < hard_.size(); ++b) {
    const Body& body = model_->bodies[b];
    std::fill_n(body_of_.begin() + std::ptrdiff_t(body.first_vertex), body.vertices, std::uint32_t(b));
    if (rigid[b]) hard_[b] = make_hard_body(*model_, body, start_, substep.v, substep.h);
  }
}

std::array<HardBody*, 2> OffsetContact::hard_sides(const Pair& pair) {
  if (hard_.empty()) return {};
  const auto of = [&](std::uint32_t vertex) {
    HardBody& body = hard_[body_of_[vertex]];
    return body.moves ? &body : nullptr;
  };
  return {of(pair.vertices[0]), of(pair.vertices[3])};
}

// Pairs that act, and those that did, whose impulses bodies already have.
std::vector<OffsetContact::HardPair> OffsetContact::find_hard_pairs() {
  std::vector<HardPair> found;
  for (Pair& pair : pairs_) {
    const auto sides = hard_sides(pair);
    if (!sides[0] && !sides[1]) pair.warm = {};
    if ((!sides[0] && !sides[1]) || !(pair.acts() || pair.warm.size > 0)) continue;
    for (HardBody* side : sides)
      if (side) ++side->pairs;
    found.push_back({.pair = &pair, .sides = sides});
  }
  return found;
}

void OffsetContact::set_out(const Settings& settings, const std::vector<int>& shared, const Substep& substep,
                            HardPair& hard) {
  const Pair& pair = *hard.pair;
  std::array<glm::dvec3, 2> points{};
  for (std::size_t k = 0; k < 4; ++k)
    points[pair.side_of(k)] += std::abs(pair.near.weights[k]) * start_[pair.vertices[k]];
  // Both sides have the impulse at the same point, or it would turn them.
  const glm::dvec3 point = !hard.sides[0] ? points[0] : !hard.sides[1] ? points[1] : (points[0] + points[1]) / 2.0;
  for (std::size_t side = 0; side < 2; ++side)
    if (hard.sides[side]) hard.arms[side] = point - hard.sides[side]->centre;
  for (std::size_t k = 0; k < 4; ++k) {
    if (hard.sides[pair.side_of(k)]) continue;
    const std::uint32_t i = pair.vertices[k];
    const double b = pair.near.weights[k];
    hard.soft_way += b * (substep.x[i] - start_[i]);
    if (pair.shares[k] > 0) hard.soft_weight += b * b * substep.weights[i] * shared[i] / double(pair.shares[k]);
  }
  hard.touch = {.normal = pair.near.normal,
                .arm = {},
                .least = -std::max(0.0, pair.near.distance - pair.offset),
                .impulse = pair.warm.impulse,
                .response = {},
                .stopping = {},
                .surface = {},
                .friction = mean_of_bodies(friction_of, settings, pair)};
  hard.before = hard.touch.impulse;
  hard.touch.least =
      Formula{}.least_way(glm::dot(way_of(hard), hard.touch.normal), hard.touch.least,
                          substep.h * substep.h * settings.gravity, mean_of_bodies(restitution_of, settings, pair));
}

// Of the first side relative to the second, with all impulses so far.
glm::dvec3 OffsetContact::way_of(const HardPair& hard) {
  glm::dvec3 way = hard.soft_way + hard.soft_weight * hard.touch.impulse;
  for (std::size_t side = 0; side < 2; ++side)
    if (hard.sides[side]) way += sign_of(side) * hard.sides[side]->way_at(hard.arms[side]);
  return way;
}

glm::dmat3 OffsetContact::response_of(const HardPair& hard, int HardBody::*sharing) {
  glm::dmat3 response(hard.soft_weight);
  for (std::size_t side = 0; side < 2; ++side)
    if (const HardBody* body = hard.sides[side]) response += body->response_at(hard.arms[side], body->*sharing);
  return response;
}

// All pairs at once, each on its part of the masses, and further in the direction of the last pass (Nesterov), as long
// as that is downhill (O'Donoghue and Candes 2015). Whether impulses have settled.
bool OffsetContact::pass_over(std::vector<HardPair>& hard_pairs, int pass, bool last) {
  for (HardBody& body : hard_) body.active = 0;
  for (HardPair& hard : hard_pairs) {
    hard.active = hard.touch.impulse != glm::dvec3(0) ||
                  (hard.pair->acts() && glm::dot(way_of(hard), hard.touch.normal) < hard.touch.least);
    for (HardBody* side : hard.sides)
      if (side && hard.active) ++side->active;
  }
  std::vector<HardBody> after = hard_;
  double change = 0, largest = 0;
  for (HardPair& hard : hard_pairs) {
    if (!hard.active) continue;
    hard.touch.response = response_of(hard, &HardBody::active);
    hard.touch.stopping = glm::inverse(hard.touch.response);
    const glm::dvec3 was = hard.touch.impulse,
                     now = hard.pair->acts() ? Formula{}.impulse_at(hard.touch, way_of(hard)) : glm::dvec3(0);
    const bool further = pass > 0 && !last && glm::dot(now - was, now - hard.before) >= 0;
    hard.touch.impulse = now + (further ? pass / (pass + 3.0) : 0.0) * (now - hard.before);
    hard.before = now;
    change = std::max(change, glm::length(hard.touch.impulse - was));
    largest = std::max(largest, glm::length(hard.touch.impulse));
    for (std::size_t side = 0; side < 2; ++side)
      if (hard.sides[side])
        after[std::size_t(hard.sides[side] - hard_.data())].change(sign_of(side) * (hard.touch.impulse - was),
                                                                   hard.arms[side]);
  }
  std::ranges::copy(after, hard_.begin());
  return change <= settled * largest;
}

// Impulses that add up over passes. They begin with those of the substep before, with which rigid bodies began this
// one: so do obstacles know what others press on a body.
void OffsetContact::solve_hard_pairs(const Settings& settings, double push_limit, const std::vector<int>& shared,
                                     const Substep& substep, Points& stopped, Points& pushed) {
  std::vector<HardPair> hard_pairs = find_hard_pairs();
  for (HardPair& hard : hard_pairs) set_out(settings, shared, substep, hard);
  bool last = false;
  for (int pass = 0; !last && !hard_pairs.empty(); ++pass) {
    last = pass + 1 == most_passes;
    // What is left of a change goes no further.
    if (pass_over(hard_pairs, pass, last) && !last) pass_over(hard_pairs, pass + 1, last = true);
  }
  for (const HardPair& hard : hard_pairs) {
    Pair& pair = *hard.pair;
    const glm::dvec3 impulse = hard.touch.impulse, n = pair.near.normal;
    pair.warm = followed(pair.warm, impulse);
    Formula::Meeting meeting{};
    meeting.weight = glm::dot(n, response_of(hard, &HardBody::pairs) * n);
    const glm::dvec3 push =
        pair.acts() ? Formula{}.push_apart(pair.near, meeting, pair.offset, push_limit) * n : glm::dvec3(0);
    for (std::size_t side = 0; side < 2; ++side)
      if (hard.sides[side])
        hard.sides[side]->note(sign_of(side) * pair.warm.impulse, sign_of(side) * push, hard.arms[side]);
    for (std::size_t k = 0; k < 4; ++k) {
      if (hard.sides[pair.side_of(k)]) continue;
      const std::uint32_t i = pair.vertices[k];
      stopped[i] += substep.weights[i] * pair.near.weights[k] * impulse;
      pushed[i] += substep.weights[i] * pair.near.weights[k] * push;
    }
  }
}

void OffsetContact::move_hard_bodies(const Substep& substep) {
  for (const HardBody& hard : hard_) wrenches_.push_back(hard.next);
  for (std::size_t b = 0; b < hard_.size(); ++b) {
    const HardBody& hard = hard_[b];
    if (!hard.moves || hard.pairs == 0) continue;
    const Body& body = model_->bodies[b];
    const glm::dvec3 turn = Formula{}.half_tangent(hard.changed_turn + hard.pushed_turn),
                     centre = hard.centre + hard.way - hard.changed;
    for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i) {
      const glm::dvec3 arm = substep.x[i] - centre;
      substep.v[i] += (hard.changed + glm::cross(hard.changed_turn, arm)) / substep.h;
      substep.x[i] += hard.changed + hard.pushed + Formula{}.moved_by_turn(turn, arm);
    }
  }
}

}  // namespace tetpbd
