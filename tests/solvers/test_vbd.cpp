// Mode vbd: its colours, a sweep against the same in double, its steps against implicit Euler, and what it keeps.
#include <doctest/doctest.h>

#include <set>

#include "sim/error.h"
#include "sim/model/material.h"
#include "sim/sim.h"
#include "sim/snapshot.h"
#include "sim/solvers/colours.h"
#include "tests/gl_test.h"
#include "tests/reference/reference_scenes.h"

using namespace tetpbd;
using reference_scenes::centre_of, reference_scenes::irregular_block, reference_scenes::largest_distance,
    reference_scenes::noise;

namespace {

Settings soft(const std::string& material, int iterations, double tau = 0) {
  Settings settings;
  settings.mode = "vbd", settings.material = material, settings.constraint_damping = tau;
  settings.young_modulus = 1e5, settings.iterations = iterations, settings.substeps = 1;
  if (material == "none") {
    settings.compliance[index_of<Stretch>] = 1e-4, settings.compliance[index_of<Volume>] = 5e-9;
    settings.compliance[index_of<Bend>] = 1;
  }
  return settings;
}

// What a constraint asks of one of its vertices, without damping.
template <class Kind>
auto corner(const ConstraintList& list, std::size_t c, const double* compliance, const std::vector<glm::dvec3>& x,
            std::size_t vertex) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  std::array<glm::dvec3, arity> at;
  for (std::size_t k = 0; k < arity; ++k) at[k] = x[list.ends(c)[k]];
  const int i = int(std::ranges::find(list.ends(c), vertex) - list.ends(c).begin());
  const double* rest = &list.rest[c * std::size_t(Kind::row.values)];
  Formulas<double>::VertexPart part{};
  if constexpr (Kind::row.averaged) {
    FAIL("mode vbd has no averages");
  } else if constexpr (Kind::row.components == 2) {
    part = Formulas<double>{}.neo_hookean_corner(at.data(), rest, compliance, i);
  } else {
    const auto value = Kind::template evaluate<double>(at.data(), rest_values<Kind>(rest));
    const glm::dvec3 gradient = value.gradient[i];
    part.block = glm::outerProduct(gradient, gradient) / *compliance;
    if constexpr (std::is_same_v<Kind, Stretch>)
      part.block -= Formulas<double>{}.stretch_curvature(value, at.data(), i, 1 - i) / *compliance;
    part.gradient = gradient * (value.C / *compliance);
  }
  return part;
}

void sweep_once(const Sim& sim, const std::vector<std::uint32_t>& order, const std::vector<glm::dvec3>& y,
                std::vector<glm::dvec3>& x) {
  const double h = sim.plan.h;
  for (const std::uint32_t v : order) {
    if (sim.inverse_masses[v] == 0) continue;
    const double inertia = 1 / (sim.inverse_masses[v] * h * h);
    glm::dmat3 block(inertia);
    glm::dvec3 force = -inertia * (x[v] - y[v]);
    for_each_elastic(sim.system, sim.settings.compliance, [&](auto kind, const ConstraintList& list, auto&& alpha) {
      for (std::size_t c = 0; c < list.count(); ++c) {
        if (std::ranges::count(list.ends(c), v) == 0) continue;
        const auto part = corner<decltype(kind)>(list, c, alpha(c), x, v);
        block += part.block, force -= part.gradient;
      }
    });
    x[v] += glm::inverse(block) * force;
  }
}

// The positions after one substep of some sweeps from a state, in flight; `last` is the state a substep before.
std::vector<glm::dvec3> sweep_all(const Sim& sim, const State& state, const State* last) {
  const double h = sim.plan.h, gravity = sim.settings.gravity;
  std::vector<glm::dvec3> y = state.positions, x = y;
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (sim.inverse_masses[i] == 0) continue;
    const double gain = last ? (state.velocities[i].y - last->velocities[i].y) / (-h * gravity) : 1;
    y[i] += h * (state.velocities[i] - h * glm::dvec3(0, gravity, 0));
    x[i] = y[i] + (1 - std::clamp(gain, 0.0, 1.0)) * h * h * glm::dvec3(0, gravity, 0);
  }
  const std::vector<std::uint32_t> order = colour_vertices(sim.system, x.size()).vertices;
  std::vector<glm::dvec3> last_but_one, last_one = x;
  double omega = 1;
  for (int n = 1; n <= sim.plan.iterations; ++n) {
    sweep_once(sim, order, y, x);
    const double squared = sim.settings.acceleration * sim.settings.acceleration;
    if (n > 1) {
      omega = n == 2 ? 2 / (2 - squared) : 4 / (4 - squared * omega);
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = last_but_one[i] + omega * (x[i] - last_but_one[i]);
    }
    last_but_one = std::exchange(last_one, x);
  }
  return x;
}
glm::dvec3 momentum_of(const Model& model, const State& state) { return centre_of(model, state.velocities); }

}  // namespace

TEST_CASE("vbd: no two vertices of a colour share a constraint, and each vertex has one") {
  for (const char* kinds : {"stretch", "stretch,bend,volume", "volume"}) {
    const TetMesh mesh = irregular_block(1, false)->rest;
    const ConstraintSystem system = build_constraints(mesh, kinds);
    const VertexColours colours = colour_vertices(system, mesh.positions.size());
    std::vector<int> colour_of(mesh.positions.size(), -1);
    REQUIRE(colours.first.back() == mesh.positions.size());
    for (std::size_t c = 0; c + 1 < colours.first.size(); ++c)
      for (std::size_t k = colours.first[c]; k < colours.first[c + 1]; ++k) {
        CHECK(colour_of[colours.vertices[k]] == -1);
        colour_of[colours.vertices[k]] = int(c);
      }
    for (const ConstraintList& list : system.lists)
      for (std::size_t c = 0; c < list.count(); ++c) {
        std::set<int> met;
        for (const std::uint32_t v : list.ends(c)) met.insert(colour_of[v]);
        CHECK(met.size() == std::size_t(list.arity));
      }
    CHECK(colours.first.size() - 1 <= 20);
  }
  CHECK(colour_vertices(build_constraints(TetMesh{}, "volume"), 3).first == std::vector<std::size_t>{0, 3});
}

TEST_CASE("vbd: what a neo-Hookean tet asks of a corner is what its edges add up to") {
  reference_scenes::generator.seed(8);
  for (int trial = 0; trial < 40; ++trial) {
    std::array<glm::dvec3, 4> x = {glm::dvec3(0), {1, 0.1, 0}, {0.2, 0.9, 0.1}, {0.1, 0.3, 1.1}};
    auto rest = NeoHookean::rest(x.data());
    rest[7] = 1.4;
    const double a[2] = {3e-5, 2e-6};
    for (auto& p : x) p += noise(trial < 20 ? 0.1 : 1);
    Formulas<double> formulas;
    for (int i = 0; i < 4; ++i) {
      glm::dmat3 block(0);
      glm::dvec3 gradient(0);
      for (int j = 0; j < 4; ++j) {
        if (j == i) continue;
        const auto part = formulas.neo_hookean_part(x.data(), rest.data(), a, i, j);
        block -= part.block, gradient += part.force;
      }
      const auto part = formulas.neo_hookean_corner(x.data(), rest.data(), a, i);
      for (int c = 0; c < 3; ++c) CHECK(glm::length(block[c] - part.block[c]) < 1e-9 * glm::length(block[c]));
      CHECK(glm::length(gradient - part.gradient) < 1e-9 * (1 + glm::length(gradient)));
    }
  }
}

TEST_CASE("vbd: sweeps, accelerated or not, are what double finds in the same order of colours") {
  GlTest gl;
  for (const char* material : {"neo-hookean", "springs", "none"})
    for (const bool held : {false, true}) {
      CAPTURE(material);
      CAPTURE(held);
      const auto model = irregular_block(1, held);
      Settings settings = soft(material, held ? 4 : 1);
      settings.acceleration = held ? 0.8 : 0;
      Sim sim = create_sim(model, settings);
      State last;
      for (int s = 0; s < 3; ++s) {
        const State before = read_state(sim);
        const auto right = sweep_all(sim, before, s > 0 ? &last : nullptr);
        last = before;
        step(sim);
        const State after = read_state(sim);
        CHECK(largest_distance(after.positions, right) < 1e-6);
        double moved = 0;  // beyond inertia, or nothing was tested
        for (std::size_t i = 0; i < right.size(); ++i) {
          const glm::dvec3 v = before.velocities[i] - sim.plan.h * glm::dvec3(0, sim.settings.gravity, 0);
          if (sim.inverse_masses[i] > 0)
            moved = std::max(moved, glm::distance(right[i], before.positions[i] + sim.plan.h * v));
          if (sim.inverse_masses[i] > 0)
            CHECK(glm::distance(after.velocities[i], (after.positions[i] - before.positions[i]) / sim.plan.h) < 1e-4);
        }
        CHECK(moved > 1e-5);
      }
    }
}

TEST_CASE("vbd: sweeps go to the step of implicit Euler, damped or not") {
  GlTest gl;
  for (const char* material : {"neo-hookean", "none"})
    for (const double tau : {0.0, 5e-3}) {
      CAPTURE(material);
      CAPTURE(tau);
      const auto model = irregular_block(1, true);
      double last = 1;
      for (const int iterations : {1, 10, 100, 400}) {
        CAPTURE(iterations);
        Sim sim = create_sim(model, soft(material, iterations, tau));
        const State start = read_state(sim);
        step(sim);
        const ReferenceInput input{*model, sim.system, sim.settings, sim.inverse_masses};
        Objective objective = step_objective(input, start, sim.settings.compliance, sim.plan.h);
        if (tau > 0) objective.before = constraint_values(objective, start.positions);
        objective.damping = material == std::string("none") ? tau : 0;  // of a material by dashpots
        objective.per_step = 1 / sim.plan.h;
        const Minimum right = minimise(objective, objective.predicted);
        REQUIRE(right.converged);
        const double off = largest_distance(read_state(sim).positions, right.positions);
        CHECK(off < 0.7 * last);
        last = std::max(off, 3e-7);
      }
      CHECK(last < (tau > 0 ? 1e-5 : 2e-6));
    }
}

TEST_CASE("vbd: acceleration leaves a smaller part of an error, and may be switched on and off on the way") {
  GlTest gl;
  const auto model = irregular_block(1, true);
  const auto off_by = [&](double acceleration) {
    Settings settings = soft("neo-hookean", 25);
    settings.young_modulus = 1e7;
    Sim sim = create_sim(model, settings);
    const State start = read_state(sim);
    settings.acceleration = acceleration;
    apply_settings(sim, settings);
    step(sim);
    const ReferenceInput input{*model, sim.system, sim.settings, sim.inverse_masses};
    const Objective objective = step_objective(input, start, sim.settings.compliance, sim.plan.h);
    const Minimum right = minimise(objective, objective.predicted);
    REQUIRE(right.converged);
    const double off = largest_distance(read_state(sim).positions, right.positions);
    settings.acceleration = 0;
    apply_settings(sim, settings);
    step(sim);
    CHECK(!check_finite(sim, true));
    return off;
  };
  CHECK(off_by(0.9) < 0.5 * off_by(0));
}

TEST_CASE("vbd: a free body keeps its momentum at convergence, and fixed vertices stay") {
  GlTest gl;
  Settings settings = soft("neo-hookean", 200);
  settings.gravity = 0, settings.ground = false;
  const auto model = irregular_block(1, false);
  Sim sim = create_sim(model, settings);
  const glm::dvec3 before = momentum_of(*model, read_state(sim));
  for (int s = 0; s < 10; ++s) step(sim);
  CHECK(glm::distance(momentum_of(*model, read_state(sim)), before) < 1e-3);

  const auto held = irregular_block(1, true);
  Sim fixed = create_sim(held, settings);
  pin(fixed, 30);
  const State start = read_state(fixed);
  for (int s = 0; s < 10; ++s) step(fixed);
  const State end = read_state(fixed);
  for (const std::size_t v : {0, 1, 30}) CHECK(end.positions[v] == start.positions[v]);
  CHECK(largest_distance(end.positions, start.positions) > 1e-3);
}

TEST_CASE("vbd: same bits in every run, and from a snapshot") {
  GlTest gl;
  const auto model = irregular_block(0.02, false);
  for (const double tau : {0.0, 1e-3}) {
    CAPTURE(tau);
    Settings settings = soft("springs", 3, tau);
    settings.substeps = 3;
    Sim one = create_sim(model, settings), other = create_sim(model, settings);
    for (int s = 0; s < 10; ++s) step(one), step(other);
    CHECK(state_hash(one) == state_hash(other));
    const Buffer kept("kept", snapshot_bytes(one));
    const Snapshot snapshot = take_snapshot(one, kept, 0);
    for (int s = 0; s < 10; ++s) step(one);
    const auto hash = state_hash(one);
    restore_snapshot(one, snapshot, kept);
    for (int s = 0; s < 10; ++s) step(one);
    CHECK(state_hash(one) == hash);
  }
}

TEST_CASE("vbd: on ground without friction a body rests and does not creep, with friction it stays on a slope") {
  GlTest gl;
  for (const double friction : {0.0, 1.0}) {
    CAPTURE(friction);
    auto model = std::make_shared<Model>(*irregular_block(0, false, {}, {}));
    const double lowest = bounds(model->positions).low.y;
    for (auto& p : model->positions) p.y -= lowest;
    Settings settings = soft("neo-hookean", 30);
    settings.friction = friction, settings.damping = 5;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 200; ++s) step(sim);
    const glm::dvec3 start = centre_of(*model, model->positions), then = centre_of(*model, read_state(sim).positions);
    for (int s = 0; s < 100; ++s) step(sim);
    const glm::dvec3 now = centre_of(*model, read_state(sim).positions);
    CHECK(glm::length(glm::dvec2(now.x - then.x, now.z - then.z)) < 1e-3);
    CHECK(std::abs(now.y - then.y) < 1e-3);
    CHECK(now.y > start.y - 0.1);
  }
}

TEST_CASE("vbd: refuses what has no force") {
  GlTest gl;
  Settings hard;
  hard.mode = "vbd";
  CHECK_THROWS_WITH_AS(create_sim(irregular_block(1, false), hard), doctest::Contains("mode vbd needs forces"), Error);
}
