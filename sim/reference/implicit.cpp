#include "sim/reference/implicit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"

namespace tetpbd {

namespace {

// Friction is Coulomb's above this slip, m/s, and proportional to the slip below: a vertex that sticks creeps slower.
constexpr double least_slip = 1e-6;

// Steps of implicit Euler after an arrival on a plane, so that BDF2 has only instants after the impact to go by.
constexpr int steps_anew = 3;

// The values that a step derives from the instants before: x = z + h v, v = w + h times acceleration.
struct Start {
  Points z, w;
  std::vector<double> h;
};
Start find_start(const Implicit& run) {
  Start start{run.now.positions, run.now.velocities, std::vector<double>(run.anew.size(), run.h)};
  for (std::size_t i = 0; i < run.anew.size(); ++i) {
    if (run.anew[i] > 0) continue;
    start.z[i] = (4.0 * run.now.positions[i] - run.before.positions[i]) / 3.0;
    start.w[i] = (4.0 * run.now.velocities[i] - run.before.velocities[i]) / 3.0;
    start.h[i] = run.h * 2 / 3;
  }
  return start;
}

Objective make_objective(const Implicit& run, const Start& start) {
  const Settings& settings = run.input.settings;
  Objective o{.system = run.input.system, .compliances = run.compliances};
  o.inertia = 1 / (run.h * run.h);
  double mass = 0;
  for (std::size_t i = 0; i < start.z.size(); ++i) {
    const double h = start.h[i], w = run.input.inverse_masses[i], drag = 1 + settings.damping * h;
    // m (x - z - h w) / h^2 + damping m (x - z) / h = m g + ...
    const glm::dvec3 free = h * start.w[i] + h * h * glm::dvec3(0, -settings.gravity, 0);
    o.masses.push_back(w > 0 ? drag / (w * h * h * o.inertia) : 0), mass += o.masses.back();
    o.predicted.push_back(w > 0 ? start.z[i] + free / drag : run.now.positions[i]);
  }
  o.unit = mass * o.inertia * run.input.model.size * run.input.model.size;
  if (any_material(settings, damped)) {
    const bool has_dashpots = run.input.system.lists[index_of<Dashpot>].count() > 0;  // in place of damping of C
    o.before = constraint_values(o, run.now.positions);
    const std::vector<double> earlier = constraint_values(o, run.before.positions);
    for (std::size_t k = 0; k < earlier.size(); ++k) o.before[k] = (4 * o.before[k] - earlier[k]) / 3;
    o.per_step = 1.5 / run.h;
    o.damping = has_dashpots ? 0 : settings.constraint_damping;
  }
  return o;
}

// Finds the obstacle planes that vertices may touch in moving to `to`. Returns by how much (m) the planes near vertices
// have moved there.
double find_planes(const Implicit& run, const std::vector<MovingObstacle>& obstacles, const Points& to, Objective& o) {
  const std::vector<glm::dvec4> before = std::move(o.planes);
  o.plane_count = obstacles.size(), o.planes.clear();
  double most = 0;
  for (std::size_t i = 0; i < to.size(); ++i)
    for (const MovingObstacle& obstacle : obstacles) {
      const glm::dvec3 from = run.now.positions[i], moved = to[i] - from - run.h * obstacle.velocity_at(from);
      const auto surface = obstacle.surface_met(to[i], moved);
      const bool near = obstacle.kind->flat || surface.distance < glm::length(moved) + 1e-3 * run.input.model.size;
      o.planes.push_back(near && o.masses[i] > 0
                             ? glm::dvec4(surface.normal, glm::dot(surface.normal, to[i]) - surface.distance)
                             : glm::dvec4(0, 0, 0, -1));
      if (before.empty()) continue;
      const glm::dvec4 was = before[o.planes.size() - 1];
      const double gap = glm::dot(glm::dvec3(was), to[i]) - was.w;
      if (std::min(gap, surface.distance) < 1e-6 * run.input.model.size)
        most = std::max(most, std::abs(std::max(gap, -1.0) - surface.distance));
    }
  return most;
}

// Friction by the normal forces of the last solution, against the displacement since z.
std::vector<Objective::Drag> find_drags(const ReferenceInput& input, const Objective& o, const Start& start,
                                        const std::vector<MovingObstacle>& obstacles,
                                        const std::vector<Touching>& touching) {
  std::vector<Objective::Drag> list;
  for (const Touching& t : touching)
    if (t.force > 0) {
      const MovingObstacle& obstacle = obstacles[t.plane];
      const double h = start.h[t.vertex];
      const glm::dvec3 at = start.z[t.vertex], from = at + h * obstacle.velocity_at(at);
      list.push_back({t.vertex, glm::dvec3(o.plane(t.vertex, t.plane)), from,
                      friction_on(obstacle, input.settings, body_at(input.model, t.vertex).number) * t.force,
                      least_slip * h});
    }
  return list;
}

// Normal forces and friction depend on each other. They are found in turn until none changes by more than 1e-8 of all.
Minimum solve(const Implicit& run, const Start& start) {
  Objective o = make_objective(run, start);
  const auto obstacles = obstacles_at(run.input.model, run.input.settings, run.time[0], run.h);
  const bool has_friction = std::ranges::any_of(obstacles, [](const auto& o) { return o.friction > 0; }) ||
                            std::ranges::any_of(run.input.model.bodies, [&](const Body& b) {
                              return friction_of(run.input.settings, b.number) > 0;
                            });
  find_planes(run, obstacles, o.predicted, o);
  o.drags = find_drags(run.input, o, start, obstacles, run.touching);
  const int most_rounds = run.most > 0 || o.plane_count == 0 ? 0 : 50;
  Minimum minimum = minimise(o, o.predicted, run.most);
  for (int round = 0; minimum.converged && round < most_rounds; ++round) {
    const bool moved = find_planes(run, obstacles, minimum.positions, o) > 1e-9 * run.input.model.size;
    if (!moved && !has_friction) break;
    std::vector<double> change(run.now.positions.size(), 0);
    double all = 0, most = 0;
    for (const Objective::Drag& d : o.drags) all += d.force, change[d.vertex] -= d.force;
    std::vector<Objective::Drag> next = find_drags(run.input, o, start, obstacles, minimum.touching);
    for (const Objective::Drag& d : next) change[d.vertex] += d.force;
    for (const double c : change) most = std::max(most, std::abs(c));
    if (!moved && most <= 1e-8 * all) break;
    o.drags = std::move(next);
    minimum = minimise(o, std::move(minimum.positions));
  }
  return minimum;
}

// Makes vertices that have just arrived on a plane begin anew; false if there are none.
bool restart_arrivals(Implicit& run, const std::vector<Touching>& touching) {
  bool any = false;
  for (const Touching& t : touching) {
    const auto is_same = [&](const Touching& old) { return old.vertex == t.vertex && old.plane == t.plane; };
    if (run.anew[t.vertex] == steps_anew || std::ranges::any_of(run.touching, is_same)) continue;
    run.anew[t.vertex] = steps_anew, any = true;
  }
  return any;
}

}  // namespace

Implicit implicit(const ReferenceInput& input, const Compliances& compliances, const State& start, double h) {
  require_compliances(input.system, compliances);
  Implicit run{input, compliances, h, start, start, std::vector<int>(start.positions.size(), 1), {}};
  for (std::size_t i = 0; i < run.anew.size(); ++i) run.before.positions[i] -= h * start.velocities[i];
  return run;
}

void advance(Implicit& run, long steps) {
  for (long s = 0; s < steps; ++s) {
    Start start;
    Minimum minimum;
    do {
      start = find_start(run);
      minimum = solve(run, start);
    } while (minimum.converged && restart_arrivals(run, minimum.touching));
    if (!minimum.converged)
      throw Error("the reference did not converge",
                  fmt::format("{} after {}, residual {:.1e}", minimum.reason, minimum.iterations, minimum.residual),
                  "take shorter steps", 1);
    run.before = run.now;
    for (std::size_t i = 0; i < minimum.positions.size(); ++i) {
      if (run.anew[i] > 0) --run.anew[i];
      if (run.input.inverse_masses[i] == 0) continue;
      run.now.positions[i] = minimum.positions[i];
      run.now.velocities[i] = (minimum.positions[i] - start.z[i]) / start.h[i];
    }
    run.touching = std::move(minimum.touching);
    run.time[0] += run.h;
  }
}

}  // namespace tetpbd
