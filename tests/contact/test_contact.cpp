// Hard bodies on half spaces, in every mode: against closed forms and the rigid reference.
#include <doctest/doctest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <numbers>

#include "sim/error.h"
#include "sim/reference/rigid.h"
#include "sim/rotation.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"
#include "tests/sim_samples.h"

using namespace tetpbd;
using samples::ball_mesh;

namespace {

const std::vector<std::string> all_modes = {"node", "constraint", "cpu", "cpu-double", "cpu-fast"};

TetMesh irregular_block() {
  TetMesh mesh = make_block({1, 0.6, 0.3}, {3, 2, 2});
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    mesh.positions[i] +=
        0.02 * glm::dvec3(std::sin(12.9 * double(i)), std::sin(78.2 * double(i)), std::sin(37.7 * double(i)));
  finish_tets(mesh, "block");
  return mesh;
}

void add(Model& model, const TetMesh& mesh, const glm::dvec3& centre, const glm::dmat3& rotation = glm::dmat3(1),
         const glm::dvec3& velocity = glm::dvec3(0), const glm::dvec3& spin = glm::dvec3(0),
         const std::vector<std::uint32_t>& fixed = {}) {
  std::vector<glm::dvec3> start;
  for (const glm::dvec3& p : mesh.positions) start.push_back(centre + rotation * p);
  add_body(model, "body", mesh, 1000, start, velocity, spin, fixed);
}

glm::dmat3 tilted() { return glm::dmat3(glm::rotate(glm::dmat4(1), 0.7, glm::normalize(glm::dvec3(1, 0.5, 2)))); }

Settings in_mode(const std::string& mode, int substeps = 20) {
  Settings settings;
  settings.mode = mode, settings.iterations = 1, settings.substeps = substeps;
  return settings;
}

struct Totals {
  glm::dvec3 centre{0}, velocity{0};
  double kinetic = 0, potential = 0;
  double energy() const { return kinetic + potential; }
};
Totals totals(const Model& model, const State& state) {
  Totals t;
  double mass = 0;
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    const double m = model.masses[i];
    mass += m, t.centre += m * state.positions[i], t.velocity += m * state.velocities[i];
    t.kinetic += m * glm::dot(state.velocities[i], state.velocities[i]) / 2;
    t.potential += m * 9.81 * state.positions[i].y;
  }
  t.centre /= mass, t.velocity /= mass;
  return t;
}

glm::dvec3 angular_momentum(const Model& model, const State& state) {
  const glm::dvec3 centre = totals(model, state).centre;
  glm::dvec3 sum(0);
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    sum += model.masses[i] * glm::cross(state.positions[i] - centre, state.velocities[i]);
  return sum;
}

State after(const std::shared_ptr<Model>& model, const Settings& settings, int steps) {
  Sim sim = create_sim(model, settings);
  for (int s = 0; s < steps; ++s) step(sim);
  return read_state(sim);
}

}  // namespace

TEST_CASE_FIXTURE(GlTest, "contact: a hard ball bounces to the square of its restitution, in every mode") {
  const auto model = std::make_shared<Model>();
  add(*model, ball_mesh(0.25), {0, 0.75, 0});
  for (const std::string& mode : all_modes)
    for (const int substeps : {1, 5, 20, 50})
      for (const double restitution : {0.0, 0.5, 0.9}) {
        if (substeps != 20 && mode != "node" && mode != "cpu-double") continue;
        if (!is_long_run() && substeps != 20 && restitution != 0.5) continue;
        CAPTURE(mode);
        CAPTURE(substeps);
        CAPTURE(restitution);
        Settings settings = in_mode(mode, substeps);
        settings.restitution = restitution;
        Sim sim = create_sim(model, settings);
        double apex = 0;
        bool hit = false;
        for (int s = 0; s < 160; ++s) {
          step(sim);
          const Totals now = totals(*model, read_state(sim));
          hit = hit || (now.velocity.y > -0.5 && s > 40);
          if (hit) apex = std::max(apex, now.centre.y - 0.25);
        }
        CHECK(hit);
        // Its speed after the impact over before; without restitution it stays where it touches.
        if (restitution > 0)
          CHECK(std::sqrt(apex / 0.5) / restitution == doctest::Approx(1).epsilon(0.03));
        else
          CHECK(apex < 1e-3);
        const State end = read_state(sim);
        if (restitution == 0) CHECK(totals(*model, end).kinetic == 0);
      }
}

TEST_CASE_FIXTURE(GlTest, "contact: a hard block on a slope slides as Coulomb has it, or sticks, in every mode") {
  for (const double degrees : {25.0, 28.0})
    for (const std::string& mode : all_modes) {
      CAPTURE(degrees);
      CAPTURE(mode);
      const double angle = degrees * std::numbers::pi / 180;
      const glm::dvec3 normal(-std::sin(angle), std::cos(angle), 0), down(-std::cos(angle), -std::sin(angle), 0);
      const auto model = std::make_shared<Model>();
      add(*model, make_block({0.4, 0.2, 0.4}, {4, 2, 4}), 0.1 * normal, glm::dmat3(-down, normal, glm::dvec3(0, 0, 1)));
      model->obstacles = {samples::half_space(normal)};
      Settings settings = in_mode(mode);
      settings.ground = false;
      const glm::dvec3 moved = totals(*model, after(model, settings, 100)).centre - 0.1 * normal;
      const double pull = 9.81 * (std::sin(angle) - 0.5 * std::cos(angle));
      if (pull > 0)
        CHECK(glm::dot(moved, down) / (pull * 0.5 * 0.5 / 2) == doctest::Approx(1).epsilon(0.003));
      else
        CHECK(glm::length(moved) < 1e-6);
      CHECK(std::abs(glm::dot(moved, normal)) < 1e-4);
    }
}

TEST_CASE_FIXTURE(GlTest,
                  "contact: a hard body that falls on a corner moves on as a rigid one, in every mode, and "
                  "loses energy only") {
  const auto model = std::make_shared<Model>();
  add(*model, irregular_block(), {0, 1, 0}, tilted(), {0.3, -2, 0}, {1, 2, 3});
  RigidBody right = rigid_bodies(*model).at(0);
  const Settings any = in_mode("node");
  std::vector<glm::dvec3> turning;  // angular momentum after each step
  int impact = 0;
  for (int s = 0; s < 120; ++s) {
    const double falling = right.velocity.y;
    for (int k = 0; k < 100; ++k) advance(right, *model, any, any.dt / 100);
    if (impact == 0 && right.velocity.y > falling) impact = s;
    turning.push_back(right.angular);
  }
  REQUIRE(impact > 0);
  const Totals reference = totals(*model, make_state(*model, {right}));
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    Sim sim = create_sim(model, in_mode(mode));
    double before = totals(*model, read_state(sim)).energy(), rise = 0;
    const double start = before;
    for (int s = 0; s < 120; ++s) {
      step(sim);
      const double now = totals(*model, read_state(sim)).energy();
      rise = std::max(rise, now - before), before = now;
      if (s != impact + 2) continue;
      const glm::dvec3 angular = angular_momentum(*model, read_state(sim));
      CHECK(glm::length(angular - turning[std::size_t(s)]) < 0.02 * glm::length(turning[std::size_t(s)]));
    }
    CHECK(rise < 1e-3 * start);
    const Totals end = totals(*model, read_state(sim));
    CHECK(end.energy() / reference.energy() == doctest::Approx(1).epsilon(0.02));
    CHECK(glm::length(end.centre - reference.centre) < 0.02);
    CHECK(glm::length(end.velocity - reference.velocity) < 0.1);
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: hard bodies come to rest and stay, to the last bit (long)") {
  const auto model = std::make_shared<Model>();
  add(*model, make_block({1, 0.6, 0.3}, {3, 2, 2}), {0, 0.6, 0}, tilted(), {0.5, 0, 0}, {1, 2, 3});
  for (const char* mode : {"node", "cpu-double"}) {
    CAPTURE(mode);
    Sim sim = create_sim(model, in_mode(mode));
    for (int s = 0; s < 800; ++s) step(sim);
    const State rest = read_state(sim);
    CHECK(totals(*model, rest).kinetic == 0);
    for (int s = 0; s < 200; ++s) step(sim);
    const State later = read_state(sim);
    double moved = 0;
    for (std::size_t i = 0; i < rest.positions.size(); ++i)
      moved = std::max(moved, glm::length(later.positions[i] - rest.positions[i]));
    CHECK(moved < 1e-7 * model->size);
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: a dented hard body that lies finds its shape without a jump, in every mode") {
  const auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block({1, 0.6, 0.3}, {3, 2, 2});
  add(*model, mesh, {0, 0.2999, 0});
  for (glm::dvec3& p : model->positions) p.y *= 0.8;
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    Sim sim = create_sim(model, in_mode(mode));
    double highest = 0;
    for (int s = 0; s < 100; ++s) {
      step(sim);
      highest = std::max(highest, totals(*model, read_state(sim)).centre.y);
    }
    CHECK(highest < 0.304);
    CHECK(std::abs(totals(*model, read_state(sim)).centre.y - 0.3) < 0.001);
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: a hard body tumbles in flight by Euler's equations, in every mode") {
  const auto model = std::make_shared<Model>();
  add(*model, irregular_block(), {0, 9, 0}, glm::dmat3(1), {1, 2, 3}, {0.1, 6, 0.05});
  RigidBody right = rigid_bodies(*model).at(0);
  Settings settings = in_mode("node", 5);
  settings.ground = false;
  for (int k = 0; k < 200 * 50; ++k) advance(right, *model, settings, settings.dt / 50);
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    settings.mode = mode;
    const State end = after(model, settings, 200);
    glm::dmat3 fit(0);
    const Totals all = totals(*model, end);
    for (std::size_t i = 0; i < end.positions.size(); ++i)
      fit += model->masses[i] * glm::outerProduct(end.positions[i] - all.centre, right.rest[i]);
    const glm::dmat3 turn = glm::transpose(best_rotation(fit).R) * right.rotation;
    const double off = std::acos(std::clamp((turn[0][0] + turn[1][1] + turn[2][2] - 1) / 2, -1.0, 1.0));
    const glm::dvec3 angular = angular_momentum(*model, end);
    CHECK(glm::length(angular - right.angular) < 2e-5 * glm::length(right.angular));
    CHECK(off < 1e-3);
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: a deformed hard body finds its shape in flight, then is rigid, in every mode") {
  const auto model = std::make_shared<Model>();
  const TetMesh mesh = irregular_block();
  add(*model, mesh, {0, 3, 0}, glm::dmat3(1), glm::dvec3(0), {0, 3, 0});
  for (glm::dvec3& p : model->positions) p.x *= 1.05;
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    Settings settings = in_mode(mode, 5);
    settings.ground = false, settings.gravity = 0, settings.constraints = "stretch,volume";
    Sim sim = create_sim(model, settings);
    const auto longest = [&](const State& state) {
      double most = 0;
      for (const auto& [a, b] : tet_edges(model->rest)) {
        const double rest = glm::distance(model->rest.positions[a], model->rest.positions[b]);
        most = std::max(most, std::abs(glm::distance(state.positions[a], state.positions[b]) / rest - 1));
      }
      return most;
    };
    CHECK(longest(read_state(sim)) > 0.04);
    for (int s = 0; s < 200; ++s) step(sim);
    const State found = read_state(sim);
    for (int s = 0; s < 200; ++s) step(sim);
    const State end = read_state(sim);
    CHECK(longest(end) < 1e-5);
    const glm::dvec3 before = angular_momentum(*model, found), after = angular_momentum(*model, end);
    CHECK(glm::length(before) > 0);
    CHECK(glm::length(after - before) < 2e-5 * glm::length(before));
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: bodies do not know of each other's contacts (long)") {
  const glm::dvec3 places[] = {{0, 0.5, 0}, {3, 0.45, 0}, {6, 5, 0}};
  const auto all = std::make_shared<Model>();
  for (const glm::dvec3& place : places) add(*all, irregular_block(), place, tilted());
  for (const char* mode : {"node", "constraint", "cpu-double"}) {
    const State together = after(all, in_mode(mode), 60);
    for (std::size_t b = 0; b < 3; ++b) {
      CAPTURE(mode);
      CAPTURE(b);
      const auto one = std::make_shared<Model>();
      add(*one, irregular_block(), places[b], tilted());
      const State alone = after(one, in_mode(mode), 60);
      double apart = 0;
      for (std::size_t i = 0; i < alone.positions.size(); ++i)
        apart = std::max(apart, glm::length(alone.positions[i] - together.positions[all->bodies[b].first_vertex + i]));
      CHECK(apart < 1e-5);
    }
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: momenta of many vertices are summed as exactly on the GPU as in double") {
  const auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block({1, 0.6, 0.3}, {20, 15, 10});
  double low = 0;
  for (const glm::dvec3& p : mesh.positions) low = std::min(low, (tilted() * p).y);
  add(*model, mesh, {3, 0.0001 - low, -2}, tilted(), {0.03, -0.4, 0.01}, {0.1, 0.2, 0.3});
  const State right = after(model, in_mode("cpu-double", 5), 3), state = after(model, in_mode("node", 5), 3);
  const glm::dvec3 momentum = angular_momentum(*model, right);
  CHECK(glm::length(angular_momentum(*model, state) - momentum) < 3e-4 * glm::length(momentum));
}

TEST_CASE_FIXTURE(GlTest, "contact: what leaves the ground fast is carried on its way out, in every mode") {
  // Inside at the start and after a substep, outside after four; a little squashed, which as a free body it
  // would turn into motion.
  const auto model = std::make_shared<Model>();
  const TetMesh mesh = irregular_block();
  add(*model, mesh, {0, -0.03 - bounds(mesh.positions).low.y, 0}, glm::dmat3(1), {0, 8, 0});
  for (glm::dvec3& p : model->positions) p.x *= 0.99;
  model->obstacles.clear();
  Settings settings = in_mode("cpu-double", 1);
  settings.dt = 0.002;
  const State right = after(model, settings, 1);
  glm::dvec3 least(1e9), most(-1e9);
  for (const glm::dvec3& v : right.velocities) least = glm::min(least, v), most = glm::max(most, v);
  CHECK(glm::length(most - least) < 1e-6);  // it moves as one
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    settings.mode = mode;
    const State state = after(model, settings, 1);
    for (std::size_t i = 0; i < state.velocities.size(); ++i)
      CHECK(glm::length(state.velocities[i] - right.velocities[i]) < 1e-4);
  }
}

TEST_CASE_FIXTURE(GlTest, "contact: bodies with hinges, or held somewhere, move as their constraints have them") {
  TetMesh hinge;  // two tets with an edge in common
  hinge.positions = {{0, 0, 0}, {1, 0, 0}, {0.3, 0.8, 0}, {0.3, 0.2, 0.8}, {0.3, -0.6, -0.8}, {0.4, 0.3, -0.9}};
  hinge.tets = {{0, 1, 2, 3}, {0, 1, 4, 5}};
  finish_tets(hinge, "hinge");
  CHECK(!hinge.one_piece);
  CHECK(irregular_block().one_piece);
  const auto hinged = std::make_shared<Model>(), held = std::make_shared<Model>();
  add(*hinged, hinge, {0, 0.9, 0});
  add(*held, irregular_block(), {0, 0.4, 0}, tilted(), glm::dvec3(0), glm::dvec3(0), {0});
  for (const auto& model : {hinged, held})
    for (const std::string& mode : all_modes) {
      CAPTURE(mode);
      Settings settings = in_mode(mode);
      const State with = after(model, settings, 60);
      settings.rigid_contact = false;
      const State without = after(model, settings, 60);
      CHECK(with.positions == without.positions);
      const glm::dvec3 start = totals(*model, {model->positions, model->velocities}).centre;
      CHECK(glm::length(totals(*model, with).centre - start) > 0.01);
    }
}

TEST_CASE("contact: restitution is of hard bodies") {
  Settings settings;
  settings.restitution = 0.5;
  check_settings(settings, "here");
  const auto refused = [&](auto&& change) {
    Settings other = settings;
    change(other);
    CHECK(!any_moves_rigidly(other));
    CHECK_THROWS_AS(check_settings(other, "here"), Error);
  };
  refused([](Settings& s) { s.stiffness[0] = 0.9; });
  refused([](Settings& s) { s.compliance[0] = 1e-6; });
  refused([](Settings& s) { s.material = "neo-hookean"; });
  refused([](Settings& s) { s.rigid_contact = false; });
  refused([](Settings& s) { s.constraints = "volume"; });
}

TEST_CASE_FIXTURE(GlTest,
                  "contact: what is left out of a hard body's contacts is counted, and nothing else is (long)") {
  const auto model = std::make_shared<Model>();
  add(*model, irregular_block(), {0, 0.35, 0});
  // A cage of walls that close in on it from all sides, each dragging another way.
  const auto cage = std::make_shared<Model>(*model);
  for (int k = 0; k < 24; ++k) {
    const double y = 1 - (2 * k + 1) / 24.0, turn = 2.4 * k, r = std::sqrt(1 - y * y);
    const glm::dvec3 n(r * std::cos(turn), y, r * std::sin(turn));
    Obstacle wall = samples::half_space(n, glm::dot(n, glm::dvec3(0, 0.35, 0)) - 0.6);
    wall.velocity = 2.0 * n + glm::cross(n, glm::dvec3(std::sin(3.0 * k), 1, std::cos(5.0 * k)));
    wall.friction = 0.7;
    cage->obstacles.push_back(wall);
  }
  const auto fast = std::make_shared<Model>();
  add(*fast, irregular_block(), {0, 0.35, 0}, glm::dmat3(1), {1500, -1, 0});
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    const auto run = [&](const std::shared_ptr<const Model>& one, int steps) {
      Sim sim = create_sim(one, in_mode(mode));
      for (int s = 0; s < steps; ++s) step(sim);
      const auto first = dropped(sim);
      CHECK(dropped(sim) == first);
      Settings other = sim.settings;
      other.mode = mode == "node" ? "constraint" : "node";
      apply_settings(sim, other);
      CHECK(dropped(sim) == first);
      reset(sim);
      CHECK(dropped(sim).empty());
      return std::map(first.begin(), first.end());
    };
    CHECK(run(model, is_long_run() ? 200 : 60).empty());
    auto caged = run(cage, 60);
    const bool cpu = find_solver_mode(mode)->cpu;  // where contacts are found anew in each substep, and fewer
    CHECK((caged["rigid_contacts"] > 0) == !cpu);
    CHECK(caged["rigid_sweeps"] > 0);
    CHECK((run(fast, 3)["rigid_range"] > 0) == !cpu);
  }
}
