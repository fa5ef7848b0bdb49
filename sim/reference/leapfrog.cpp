#include "sim/reference/leapfrog.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/reference/smoothed.h"

namespace tetpbd {

namespace {

// Calls for_each_elastic with the offset of the list's first part in addition.
template <class F>
void for_each_spring(const Leapfrog& run, F&& visit) {
  std::size_t offset = 0;
  for_each_elastic<true>(run.input.system, run.compliances, [&](auto kind, const ConstraintList& list, auto&& alpha) {
    if (run.input.ten_node && std::is_same_v<decltype(kind), NeoHookean>) return;
    visit(kind, list, alpha, offset);
    offset += list.vertices.size();
  });
}

// Accelerations of vertices with mass by gravity and constraints, whose force is -(C + tau grad C . v) grad C / alpha,
// and -(grad C . v) grad C / alpha where only the rate counts.
Points accelerations(Leapfrog& run) {
  const double all = run.input.settings.constraint_damping;
  const Averages& rings = run.input.system.averages;
  run.averages = find_averages(rings, run.x);
  const bool has_dashpots = run.input.system.lists[index_of<Dashpot>].count() > 0;  // in place of damping of C
  for_each_spring(run, [&](auto kind, const ConstraintList& list, auto&& alpha, std::size_t offset) {
    constexpr std::size_t arity = std::size_t(decltype(kind)::row.arity);
    parallel_for(list.count(), 1024, [&](std::size_t c) {
      const std::uint32_t* vertices = list.vertices.data() + c * arity;
      std::array<glm::dvec3, arity> x;
      for (std::size_t j = 0; j < arity; ++j) {
        x[j] = run.x[vertices[j]] - run.x[vertices[0]];
        run.parts[offset + c * arity + j] = glm::dvec3(0);
      }
      const auto value = unclamped<decltype(kind)>(x, &list.rest[c * std::size_t(kind.row.values)]);
      for (int k = 0; k < kind.row.components; ++k) {
        const auto [C, gradient] = component(value, k);
        double size = kind.row.rate ? 0 : C;
        if constexpr (kind.row.averaged)
          if (k == 1) size -= own_volume(x, vertices, list, c, run.averages).excess;
        const double damping = kind.row.rate ? 1 : list.damping_at(c, has_dashpots ? 0 : all);
        for (std::size_t j = 0; j < arity; ++j) size += damping * glm::dot(gradient[j], run.v[vertices[j]]);
        for (std::size_t j = 0; j < arity; ++j) run.parts[offset + c * arity + j] -= size / alpha(c)[k] * gradient[j];
      }
    });
  });
  const std::size_t first = run.parts.size() - 10 * run.tets.size();
  parallel_for(run.tets.size(), 256, [&](std::size_t t) {
    std::ranges::copy(forces(run.tets[t], run.x), run.parts.begin() + std::ptrdiff_t(first + 10 * t));
  });
  const glm::dvec3 gravity(0, -run.input.settings.gravity, 0);
  const Points pull = average_forces(rings, run.averages);
  Points a(run.x.size(), glm::dvec3(0));
  parallel_for(a.size(), 1024, [&](std::size_t i) {
    if (run.input.inverse_masses[i] == 0) return;
    glm::dvec3 force = pull.empty() ? glm::dvec3(0) : pull[i];
    for (std::uint32_t k = run.at_vertex.first[i]; k < run.at_vertex.first[i + 1]; ++k)
      force += run.parts[run.at_vertex.values[k]];
    a[i] = gravity + force * run.input.inverse_masses[i];
  });
  return a;
}

// Moves a vertex out of a plane, at `depth` (m) behind it after a displacement `moved` relative to it, without bounce:
// its depth is undone, and as much of its slip as friction can. The solvers' formula would share their mistakes.
void resolve_contact(const glm::dvec3& n, double depth, double friction, const glm::dvec3& moved, double h,
                     glm::dvec3& x, glm::dvec3& v) {
  if (depth <= 0) return;
  const glm::dvec3 slip = moved - n * glm::dot(n, moved);
  const double length = glm::length(slip), undone = std::min(length, friction * depth);
  const glm::dvec3 correction = depth * n - (length > 0 ? slip * (undone / length) : glm::dvec3(0));
  x += correction;
  v += correction / h;
}

Leapfrog prepare(const ReferenceInput& input, const Compliances& compliances, const Points& positions) {
  require_compliances(input.system, compliances);
  Leapfrog run{input, compliances, 0, positions, Points(positions.size(), glm::dvec3(0)), {}, {}, {}, {0}};
  std::vector<std::uint32_t> vertices;
  for_each_spring(run, [&](auto, const ConstraintList& list, auto&&, std::size_t) {
    vertices.insert(vertices.end(), list.vertices.begin(), list.vertices.end());
  });
  if (input.ten_node) run.tets = ten_node_tets(input.system.lists[index_of<NeoHookean>], input.model.rest.positions);
  for (const TenNodeTet& tet : run.tets) vertices.insert(vertices.end(), tet.nodes.begin(), tet.nodes.end());
  run.parts.resize(vertices.size());
  run.at_vertex = group_by_key(vertices.size(), positions.size(),
                               [&](std::size_t part, auto&& emit) { emit(vertices[part], std::uint32_t(part)); });
  return run;
}

}  // namespace

Leapfrog leapfrog(const ReferenceInput& input, const Compliances& compliances, const State& start, double h) {
  Leapfrog run = prepare(input, compliances, start.positions);
  run.h = h;
  run.v = start.velocities;
  const Points a = accelerations(run);
  for (std::size_t i = 0; i < a.size(); ++i) run.v[i] -= h / 2 * a[i];
  return run;
}

void advance(Leapfrog& run, long steps) {
  const Settings& settings = run.input.settings;
  const double remaining = std::exp(-settings.damping * run.h);
  std::vector<MovingObstacle> obstacles;
  run.pairs.begin_step();
  for (long s = 0; s < steps; ++s, run.time[0] += run.h) {
    if (s == 0 || std::ranges::any_of(run.input.model.obstacles, moves))
      obstacles = obstacles_at(run.input.model, settings, run.time[0], run.h);
    const Points a = accelerations(run);
    run.pairs.begin(settings, run.x, run.v);
    parallel_for(a.size(), 4096, [&](std::size_t i) {
      if (run.input.inverse_masses[i] == 0) return;
      const glm::dvec3 before = run.x[i];
      run.v[i] = (run.v[i] + run.h * a[i]) * remaining;
      glm::dvec3& x = run.x[i] += run.h * run.v[i];
      for (const MovingObstacle& obstacle : obstacles) {
        const glm::dvec3 moved = x - before - run.h * obstacle.velocity_at(x);
        const auto surface = obstacle.surface_met(x, moved);
        const double friction = friction_on(obstacle, settings, body_at(run.input.model, i).number);
        resolve_contact(surface.normal, -surface.distance, friction, moved, run.h, x, run.v[i]);
      }
    });
    run.pairs.resolve(settings, run.x, run.v, run.input.inverse_masses, run.h);
  }
  for (std::size_t i = 0; i < run.x.size(); ++i)
    if (!std::isfinite(glm::dot(run.x[i], run.x[i]) + glm::dot(run.v[i], run.v[i])))
      throw Error("the reference motion is not finite", fmt::format("vertex {}, steps of {:.3g} s", i, run.h),
                  "take shorter ones", 1);
}

State make_state(Leapfrog& run) {
  State state{run.x, run.v};
  const Points a = accelerations(run);
  for (std::size_t i = 0; i < a.size(); ++i) state.velocities[i] += run.h / 2 * a[i];
  return state;
}

namespace {

// The largest eigenvalue that power iterations find; `apply` multiplies a vector of that length by the matrix.
template <class Apply>
double largest_eigenvalue(std::size_t count, int iterations, Apply&& apply) {
  std::mt19937 random(1);
  Points p(count);
  for (glm::dvec3& q : p) q = {draw_unit(random), draw_unit(random), draw_unit(random)};
  double largest = 0;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    double squares = 0;
    for (std::size_t i = 0; i < p.size(); ++i) squares += glm::dot(p[i], p[i]);
    if (!(squares > 0)) return 0;
    p = apply(p, std::sqrt(double(p.size()) / squares));
    double sum = 0;
    for (std::size_t i = 0; i < p.size(); ++i) sum += glm::dot(p[i], p[i]);
    largest = std::sqrt(sum / double(p.size()));
  }
  return largest;
}

}  // namespace

double stable_step(const ReferenceInput& input, const Compliances& compliances, const Points& positions,
                   int iterations) {
  Leapfrog run = prepare(input, compliances, positions);
  // Of how accelerations fall where `moved`, positions or velocities, go `reach` to either side of what they are.
  const auto eigenvalue = [&](Points& moved, double reach) {
    const Points about = moved;
    const double largest = largest_eigenvalue(about.size(), iterations, [&](const Points& p, double scale) {
      const auto at = [&](double sign) {
        for (std::size_t i = 0; i < p.size(); ++i)
          moved[i] = about[i] + (input.inverse_masses[i] > 0 ? sign * reach * scale : 0) * p[i];
        return accelerations(run);
      };
      Points next = at(-1);
      const Points ahead = at(1);
      for (std::size_t i = 0; i < next.size(); ++i) next[i] = (next[i] - ahead[i]) / (2 * reach);
      return next;
    });
    moved = about;
    return largest;
  };
  const double stiffness = eigenvalue(run.x, 1e-7 * input.model.size);
  // What damps may be less than what is stiff: dashpots resist lengths alone.
  const double damping = most_damping(input.settings) > 0 ? eigenvalue(run.v, 1) : 0;
  // h^2 W^2 + 2 h D = 4, both with the reserve that a few power iterations need.
  const double omega = std::sqrt(1.02 * stiffness), damped = 1.02 * damping / omega;
  return (std::sqrt(damped * damped + 4) - damped) / omega;
}

double stiffest_constraint(const ReferenceInput& input, const Compliances& compliances, const Points& positions) {
  double stiffest = 0;
  for_each_elastic(input.system, compliances, [&](auto kind, const ConstraintList& list, auto&& alpha) {
    constexpr std::size_t arity = std::size_t(decltype(kind)::row.arity);
#pragma omp parallel for reduction(max : stiffest)
    for (std::size_t c = 0; c < list.count(); ++c) {
      const auto vertices = list.ends(c);
      std::array<glm::dvec3, arity> x;
      for (std::size_t j = 0; j < arity; ++j) x[j] = positions[vertices[j]] - positions[vertices[0]];
      std::array<double, arity> weights;
      for (std::size_t j = 0; j < arity; ++j)
        weights[j] = input.inverse_masses[vertices[j]] * input.system.at_vertex[vertices[j]];
      const auto value = unclamped<decltype(kind)>(x, &list.rest[c * std::size_t(kind.row.values)]);
      Formulas<double> formulas;
      if constexpr (kind.row.averaged)
        stiffest =
            std::max(stiffest, formulas.smoothed_bound(value, x.data(), weights.data(), &list.rest[8 * c], alpha(c)));
      else if constexpr (kind.row.components == 2)
        stiffest = std::max(stiffest, formulas.stiffness_bound(value, x.data(), weights.data(), alpha(c)));
      else
        stiffest = std::max(stiffest, formulas.stiffness_bound(value, x.data(), weights.data(), *alpha(c)));
    }
  });
  return stiffest;
}

}  // namespace tetpbd
