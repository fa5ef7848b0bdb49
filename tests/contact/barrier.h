// Contact by barriers (Li et al. 2020, Incremental Potential Contact), in double and without friction: an independent
// answer to how bodies bounce and rest. The energy of a pair rises without limit as its distance goes to 0, each step
// of the trapezoidal rule minimises an energy, by L-BFGS, and no step of the search takes a pair through another.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>

#include "sim/contact/offset_contact.h"
#include "sim/reference/objective.h"

namespace tetpbd {

struct BarrierRun {
  const Model& model;
  const ConstraintSystem& system;
  const Compliances& compliances;
  double h, reach, stiffness;  ///< s; m, at which pairs begin to act; J/m^2
  double gravity = 0;          ///< m/s^2, downwards
  Points x = model.positions, v = model.velocities, forces{};
  int most_iterations = 0;  ///< of all steps so far
  double nearest = INFINITY;

  struct Pair {
    bool edges;
    std::array<std::uint32_t, 4> vertices;
  };
  std::vector<Pair> all{}, near{};
  Points listed{};                    // where `near` is of
  static constexpr double spare = 1;  // times reach: how far vertices may move before the list is made anew

  using Formulas = tetpbd::Formulas<double>;
  Formulas::Proximity proximity(const Pair& pair, const Points& at) const {
    const auto side = [&](std::size_t k) { return at[pair.vertices[k]] - at[pair.vertices[0]]; };
    return pair.edges ? Formulas{}.edge_edge_proximity(side(1), side(2), side(3))
                      : Formulas{}.vertex_triangle_proximity(side(1), side(2), side(3));
  }
  void list_all() {
    const Surfaces surfaces = lay_out_surfaces(model);
    const auto body = [&](std::uint32_t vertex) { return &body_at(model, vertex); };
    for (const std::uint32_t i : surfaces.vertices)
      for (const auto& [a, b, c] : model.rest.surface)
        if (body(i) != body(a)) all.push_back({false, {i, a, b, c}});
    for (std::size_t e = 0; e < surfaces.edges.size(); ++e)
      for (std::size_t f = e + 1; f < surfaces.edges.size(); ++f)
        if (const auto& a = surfaces.edges[e], &b = surfaces.edges[f]; a.body != b.body)
          all.push_back({true, {a.ends[0], a.ends[1], b.ends[0], b.ends[1]}});
  }
  void list_near(const Points& at) {
    if (all.empty()) list_all();
    near.clear(), listed = at;
    const double far = (1 + 2 * spare) * reach;
    for (const Pair& pair : all) {
      const std::size_t own = pair.edges ? 2 : 1;
      glm::dvec3 low(INFINITY), high(-INFINITY), other_low(INFINITY), other_high(-INFINITY);
      for (std::size_t k = 0; k < 4; ++k) {
        auto& lowest = k < own ? low : other_low;
        auto& highest = k < own ? high : other_high;
        lowest = glm::min(lowest, at[pair.vertices[k]]), highest = glm::max(highest, at[pair.vertices[k]]);
      }
      if (glm::any(glm::greaterThan(low - far, other_high)) || glm::any(glm::greaterThan(other_low - far, high)))
        continue;
      if (proximity(pair, at).distance < far) near.push_back(pair);
    }
  }
  // Of -(d - r)^2 log(d / r), r the reach, over the stiffness.
  double barrier(double d) const { return d < reach ? -(d - reach) * (d - reach) * std::log(d / reach) : 0; }
  double slope(double d) const {
    return d < reach ? -2 * (d - reach) * std::log(d / reach) - (d - reach) * (d - reach) / d : 0;
  }
  double contact_energy(const Points& at, Points* gradient) const {
    double sum = 0;
    for (const Pair& pair : near) {
      const auto p = proximity(pair, at);
      if (p.distance >= reach) continue;
      sum += stiffness * barrier(p.distance);
      for (std::size_t k = 0; k < 4 && gradient; ++k)
        (*gradient)[pair.vertices[k]] += stiffness * slope(p.distance) * p.weights[k] * p.normal;
    }
    return sum;
  }
  // How far along `way` all pairs keep a tenth of their distances, and vertices stay within what is listed.
  double longest(const Points& at, const Points& way) const {
    double part = 1;
    for (const Pair& pair : near) {
      const std::size_t own = pair.edges ? 2 : 1;
      double sides[2] = {0, 0};
      for (std::size_t k = 0; k < 4; ++k)
        sides[k < own ? 0 : 1] = std::max(sides[k < own ? 0 : 1], glm::length(way[pair.vertices[k]]));
      const double d = proximity(pair, at).distance;
      if (part * (sides[0] + sides[1]) > 0.9 * d) part = 0.9 * d / (sides[0] + sides[1]);
    }
    return part;
  }
  void step() {
    Objective o{.system = system, .compliances = compliances};
    o.inertia = 4 / (h * h);
    const Points from = x;
    if (forces.empty()) forces = find_forces(x);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const bool moves = model.inverse_masses[i] > 0;
      o.masses.push_back(moves ? model.masses[i] : 0);
      const glm::dvec3 pull = forces[i] * model.inverse_masses[i] + 2.0 * glm::dvec3(0, -gravity, 0);
      o.predicted.push_back(moves ? x[i] + h * v[i] + (h * h / 4) * pull : x[i]);
    }
    minimise_energy(o);
    forces = find_forces(x);
    for (std::size_t i = 0; i < x.size(); ++i)
      if (model.inverse_masses[i] > 0) v[i] = 2.0 / h * (x[i] - from[i]) - v[i];
  }
  // Elastic forces and those of contact, N.
  Points find_forces(const Points& at) {
    list_near(at);
    Objective o{
        .system = system, .compliances = compliances, .masses = std::vector<double>(at.size(), 0), .predicted = at};
    Points g = gradient(o, at);
    contact_energy(at, &g);
    for (glm::dvec3& f : g) f = -f;
    return g;
  }

 private:
  double value(const Objective& o, const Points& at) const { return energy(o, at) + contact_energy(at, nullptr); }
  Points slopes(const Objective& o, const Points& at) const {
    Points g = gradient(o, at);
    contact_energy(at, &g);
    for (std::size_t i = 0; i < g.size(); ++i)
      if (!(o.masses[i] > 0)) g[i] = glm::dvec3(0);
    return g;
  }
  static double product(const Points& a, const Points& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += glm::dot(a[i], b[i]);
    return sum;
  }
  void minimise_energy(const Objective& o) {
    struct Change {
      Points step, slope;
      double weight;
    };
    std::deque<Change> changes;
    double now = value(o, x);
    Points g = slopes(o, x);
    for (int iteration = 0; iteration < 400; ++iteration) {
      most_iterations = std::max(most_iterations, iteration);
      Points way = g;
      std::vector<double> along(changes.size());
      for (std::size_t k = changes.size(); k-- > 0;) {
        along[k] = product(changes[k].step, way) / changes[k].weight;
        for (std::size_t i = 0; i < way.size(); ++i) way[i] -= along[k] * changes[k].slope[i];
      }
      for (std::size_t i = 0; i < way.size(); ++i)
        way[i] *= o.masses[i] > 0 ? 1 / (o.inertia * o.masses[i]) : 0;  // as without forces
      for (std::size_t k = 0; k < changes.size(); ++k) {
        const double back = product(changes[k].slope, way) / changes[k].weight;
        for (std::size_t i = 0; i < way.size(); ++i) way[i] += (along[k] - back) * changes[k].step[i];
      }
      for (glm::dvec3& w : way) w = -w;
      const double fall = product(g, way);
      double farthest = 0;
      for (std::size_t i = 0; i < way.size(); ++i) farthest = std::max(farthest, glm::length(way[i]));
      if (!(farthest > 1e-9 * reach) || !(fall < 0)) break;
      for (std::size_t i = 0; i < x.size(); ++i)
        if (glm::distance(x[i], listed[i]) + farthest > spare * reach) {
          list_near(x);
          break;
        }
      double part = std::min(longest(x, way), spare * reach / farthest);
      Points next = x;
      double then = INFINITY;
      for (int halvings = 0; halvings < 40; ++halvings, part /= 2) {
        for (std::size_t i = 0; i < x.size(); ++i) next[i] = x[i] + part * way[i];
        then = value(o, next);
        if (then <= now + 1e-4 * part * fall) break;
      }
      if (!(then < now)) break;
      const Points before = std::move(g);
      g = slopes(o, next);
      Change change{next, g, 0};
      for (std::size_t i = 0; i < x.size(); ++i) change.step[i] -= x[i], change.slope[i] -= before[i];
      change.weight = product(change.step, change.slope);
      if (change.weight > 0) changes.push_back(std::move(change));
      if (changes.size() > 20) changes.pop_front();
      x = next, now = then;
    }
    for (const Pair& pair : near) nearest = std::min(nearest, proximity(pair, x).distance);
  }
};

}  // namespace tetpbd
