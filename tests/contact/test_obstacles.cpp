// Obstacles with a shape: their distances, and bodies that meet them, in every mode, against closed forms.
#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "app/scene.h"
#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/measure/metrics.h"
#include "sim/model/material.h"
#include "sim/reference/implicit.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/rigid.h"
#include "sim/sim.h"
#include "sim/snapshot.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"
#include "tests/sim_samples.h"

using namespace tetpbd;
using samples::ball_mesh;

namespace {

const std::vector<std::string> all_modes = {"node", "constraint", "cpu", "cpu-double", "cpu-fast"};

using samples::half_space;
Obstacle box(const glm::dvec3& half, const glm::dvec3& centre = glm::dvec3(0)) {
  Obstacle o;
  o.kind = find_obstacle_kind("box"), o.half = half, o.centre = centre;
  return o;
}
Obstacle round_shape(const char* kind, double radius, double half_length, const glm::dvec3& centre = glm::dvec3(0)) {
  Obstacle o;
  o.kind = find_obstacle_kind(kind), o.radius = radius, o.half_length = half_length, o.centre = centre;
  return o;
}
Obstacle hills(double height = 0.2, int points = 41) {
  Obstacle o;
  o.kind = find_obstacle_kind("height-field"), o.half = {1, height, 1};
  for (int k = 0; k < points; ++k) {
    o.heights.emplace_back();
    for (int i = 0; i < points; ++i)
      o.heights.back().push_back(0.5 + 0.25 * std::sin(6.0 * i / (points - 1)) +
                                 0.25 * std::cos(5.0 * k / (points - 1)));
  }
  set_heights(o, o.heights);
  return o;
}
// A sphere as distances at the points of a grid.
Obstacle grid_sphere(double radius, int cells) {
  Obstacle o;
  o.kind = find_obstacle_kind("mesh");
  auto field = std::make_shared<DistanceField>();
  field->spacing = 2 * radius / cells, field->size = glm::ivec3(cells + 7);
  field->origin = glm::dvec3(-radius - 3 * field->spacing);
  for (int k = 0; k < field->size.z; ++k)
    for (int j = 0; j < field->size.y; ++j)
      for (int i = 0; i < field->size.x; ++i)
        field->values.push_back(float(glm::length(field->origin + field->spacing * glm::dvec3(i, j, k)) - radius));
  o.field = field;
  return o;
}
std::vector<Obstacle> every_shape() {
  return {half_space({0, 1, 0}), round_shape("sphere", 0.7, 0),     round_shape("capsule", 0.3, 0.5),
          box({0.7, 0.4, 0.5}),  round_shape("cylinder", 0.5, 0.4), hills(),
          grid_sphere(0.7, 28)};
}

MovingObstacle still(const Obstacle& o) { return moving_obstacle(o, 0, 0); }

double unit(std::mt19937& random) { return double(random()) / 4294967296.0; }
glm::dvec3 within(std::mt19937& random, double reach) {
  const double x = unit(random), y = unit(random), z = unit(random);
  return reach * (2.0 * glm::dvec3(x, y, z) - 1.0);
}

struct Setup {
  std::shared_ptr<Model> model = std::make_shared<Model>();
  Settings settings;
  Setup() { settings.iterations = 1, settings.substeps = 20, settings.ground = false; }
};
void add(Setup& to, const TetMesh& mesh, const glm::dvec3& centre, const glm::dmat3& turn = glm::dmat3(1),
         const glm::dvec3& velocity = glm::dvec3(0)) {
  std::vector<glm::dvec3> start;
  for (const glm::dvec3& p : mesh.positions) start.push_back(centre + turn * p);
  add_body(*to.model, "body", mesh, 1000, start, velocity, glm::dvec3(0), {});
}
const TetMesh slab = make_block({0.4, 0.2, 0.4}, {4, 2, 4});

void in_mode(Setup& setup, const std::string& mode) {
  setup.settings.mode = mode;
  const SolverMode& row = *find_solver_mode(mode);
  if (!row.forces) return;
  setup.settings.material = "neo-hookean", setup.settings.young_modulus = 1e6;
  if (row.implicit) setup.settings.iterations = 8, setup.settings.substeps = 1;
}

glm::dvec3 centre_of(const Model& model, const std::vector<glm::dvec3>& values) {
  double mass = 0;
  glm::dvec3 sum(0);
  for (std::size_t i = 0; i < values.size(); ++i) mass += model.masses[i], sum += model.masses[i] * values[i];
  return sum / mass;
}
double deepest(const Sim& sim) {
  double most = 0;
  const State state = read_state(sim);
  for (const Obstacle& o : sim.model->obstacles) {
    const MovingObstacle shape = moving_obstacle(o, simulated_time(sim), 0);
    for (const glm::dvec3& x : state.positions) most = std::max(most, -shape.surface_at(x).distance);
  }
  return most / sim.model->size;
}
Sim run(const Setup& setup, int steps) {
  Sim sim = create_sim(setup.model, setup.settings);
  for (int s = 0; s < steps; ++s) step(sim);
  return sim;
}

}  // namespace

TEST_CASE("obstacles: a distance's gradient is its normal, and its sign says inside") {
  std::mt19937 random(1);
  for (const Obstacle& o : every_shape()) {
    CAPTURE(o.kind->name);
    const MovingObstacle shape = still(o);
    const bool closed = o.kind->convex;
    int inside = 0, tested = 0;
    double wrong = 0;
    for (int k = 0; k < 2000; ++k) {
      const glm::dvec3 x = within(random, 0.95);
      const auto s = shape.surface_at(x);
      glm::dvec3 slope;
      for (int a = 0; a < 3; ++a) {
        glm::dvec3 d(0);
        d[a] = 1e-6;
        slope[a] = (shape.surface_at(x + d).distance - shape.surface_at(x - d).distance) / 2e-6;
      }
      inside += s.distance < 0;
      // Not beside an edge of the surface, or between its sides, where there are two normals.
      const bool smooth = glm::length(shape.surface_at(x + 1e-5 * within(random, 1)).normal - s.normal) < 1e-3;
      if (closed && smooth)
        wrong = std::max(wrong, glm::length(slope - s.normal)), ++tested;
      else if (smooth && std::abs(s.distance) < 0.02)
        wrong = std::max(wrong, 0.1 * glm::length(slope - s.normal)), ++tested;
      CHECK(std::abs(glm::length(s.normal) - 1) < 1e-12);
      if (closed && s.distance > 0)  // the nearest point is on the surface
        wrong = std::max(wrong, std::abs(shape.surface_at(x - s.distance * s.normal).distance));
    }
    CHECK(inside > 20);
    CHECK(tested > (closed ? 1500 : 20));
    CHECK(wrong < (closed ? 1e-6 : 0.06));
  }
  const auto at = [](const Obstacle& o, const glm::dvec3& x) { return still(o).surface_at(x).distance; };
  CHECK(at(box({1, 2, 3}), {4, 6, 3}) == doctest::Approx(5));
  CHECK(at(box({1, 2, 3}), {0.75, 0, 0}) == doctest::Approx(-0.25));
  CHECK(at(round_shape("capsule", 1, 2), {3, 6, 0}) == doctest::Approx(4));
  CHECK(at(round_shape("cylinder", 1, 2), {4, 6, 0}) == doctest::Approx(5));
  for (int k = 0; k < 200; ++k) {
    const glm::dvec3 x = within(random, 1.5);
    CHECK(at(grid_sphere(0.7, 28), x) <= glm::length(x) - 0.7 + 2e-3);
    if (glm::length(x) < 0.75)
      CHECK(at(grid_sphere(0.7, 28), x) == doctest::Approx(glm::length(x) - 0.7).epsilon(0.02));
  }
}

TEST_CASE("obstacles: a way meets a shape where it goes in, and nothing where it passes by") {
  std::mt19937 random(2);
  for (const Obstacle& o : every_shape()) {
    CAPTURE(o.kind->name);
    const MovingObstacle shape = still(o);
    int hits = 0, misses = 0, wrong = 0;
    for (int k = 0; k < 1000; ++k) {
      const glm::dvec3 from = within(random, 1.5), to = within(random, 1.5);
      if (!(shape.surface_at(from).distance > 0.01)) continue;
      double least = 1;
      for (int n = 1; n <= 400; ++n) {
        const glm::dvec3 x = from + n / 400.0 * (to - from);
        least = std::min(least, shape.surface_at(x).distance);
      }
      const auto met = shape.surface_met(to, to - from);
      const double cell = o.field ? 0.05 : 0.01;
      if (least < -cell) ++hits, wrong += !(met.distance < 0);
      if (least > cell) ++misses, wrong += !(met.distance > 0);
      // The plane is outside: what it stops at has not gone in.
      if (met.distance < 0 && o.kind->convex)
        wrong += shape.surface_at(to - met.distance * met.normal).distance < -1e-6;
    }
    CHECK(hits > 50);
    CHECK(misses > 50);
    CHECK(wrong == 0);
  }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: bodies come to rest on every shape, in every kind of mode (long)") {
  std::vector<std::vector<Obstacle>> grounds = {
      {half_space({0, 1, 0})}, {box({1, 0.5, 1}, {0, -0.5, 0})}, {round_shape("cylinder", 1, 0.5, {0, -0.5, 0})}};
  grounds[0][0].friction = 0.5;
  std::vector<Obstacle> rails, balls;
  for (const double x : {-0.1, 0.1}) {
    rails.push_back(round_shape("capsule", 0.05, 0.5, {x, -0.05, 0}));
    rails.back().rotation = {90, 0, 0};
    for (const double z : {-0.1, 0.1}) balls.push_back(round_shape("sphere", 0.05, 0, {x, -0.05, z}));
  }
  grounds.push_back(rails), grounds.push_back(balls);
  Obstacle flat = hills(1e-3);
  set_heights(flat, std::vector<std::vector<double>>(9, std::vector<double>(9, 0.5)));
  grounds.push_back({flat});
  for (const std::string mode : {"node", "cpu-double", "newton", "explicit"})
    for (const auto& ground : grounds) {
      if (!is_long_run() && mode == "cpu-double" && &ground < &grounds[3]) continue;
      const bool soft = mode == "newton" || mode == "explicit";
      if (soft && ground[0].kind->name != std::string(mode == "newton" ? "sphere" : "box")) continue;
      CAPTURE(mode);
      CAPTURE(ground[0].kind->name);
      Setup setup;
      add(setup, slab, {0, 0.11, 0});
      setup.model->obstacles = ground;
      in_mode(setup, mode);
      if (soft) setup.settings.constraint_damping = 2e-3;
      const Sim sim = run(setup, 60);
      CHECK(deepest(sim) < 1e-4);
      const State end = read_state(sim);
      CHECK(centre_of(*setup.model, end.positions).y == doctest::Approx(0.1).epsilon(0.02));
      CHECK(glm::length(centre_of(*setup.model, end.velocities)) < 0.02);
    }
}

TEST_CASE_FIXTURE(GlTest,
                  "obstacles: a block slides down a tilted box as Coulomb has it, or sticks, in every mode (long)") {
  for (const std::string mode : {"node", "constraint", "cpu", "cpu-double", "cpu-fast", "newton"})
    for (const double degrees : {25.0, 28.0}) {
      // The short suite has modes that share a contact at one angle each.
      if (!is_long_run() && ((mode == "constraint" && degrees < 26) || (mode.starts_with("cpu") && degrees > 26)) &&
          mode != "cpu-double")
        continue;
      CAPTURE(mode);
      CAPTURE(degrees);
      const double angle = glm::radians(degrees);
      const glm::dvec3 normal(-std::sin(angle), std::cos(angle), 0), down(-std::cos(angle), -std::sin(angle), 0);
      Setup setup;
      add(setup, slab, 0.1 * normal, glm::dmat3(-down, normal, glm::dvec3(0, 0, 1)));
      Obstacle slope = box({2, 0.5, 1}, -0.5 * normal);
      slope.rotation = {0, 0, degrees}, slope.friction = 0.5;
      setup.model->obstacles = {slope};
      in_mode(setup, mode);
      Setup plane = setup;
      setup.settings.friction = 0.9;  // the obstacle's own counts
      const auto slid = [&](const Setup& on) {
        const Sim sim = run(on, 100);
        return glm::dot(centre_of(*on.model, read_state(sim).positions) - 0.1 * normal, down);
      };
      const double way = slid(setup), pull = 9.81 * (std::sin(angle) - 0.5 * std::cos(angle));
      if (mode == "newton") {  // whose friction is smoothed: as on a half space
        plane.model = std::make_shared<Model>(*plane.model);
        plane.model->obstacles = {half_space(normal)};
        CHECK(way == doctest::Approx(slid(plane)).epsilon(0.01));
      } else if (pull > 0) {
        CHECK(way / (pull * 0.5 * 0.5 / 2) == doctest::Approx(1).epsilon(0.02));
      } else {
        CHECK(std::abs(way) < 1e-5);
      }
    }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: a hard ball bounces off a sphere to the square of the obstacle's restitution") {
  for (const std::string& mode : all_modes)
    for (const double restitution : {0.5, 0.9}) {
      CAPTURE(mode);
      CAPTURE(restitution);
      Setup setup;
      add(setup, ball_mesh(0.25), {0, 0.75, 0});
      setup.model->obstacles = {round_shape("sphere", 0.6, 0, {0, -0.6, 0})};
      setup.model->obstacles[0].restitution = restitution;
      in_mode(setup, mode);
      Sim sim = create_sim(setup.model, setup.settings);
      double apex = 0, worst = 0;
      bool hit = false;
      for (int s = 0; s < 150; ++s) {
        step(sim);
        worst = std::max(worst, deepest(sim));
        const State now = read_state(sim);
        hit = hit || (s > 40 && centre_of(*setup.model, now.velocities).y > -0.5);
        if (hit) apex = std::max(apex, centre_of(*setup.model, now.positions).y - 0.25);
      }
      CHECK(std::sqrt(apex / 0.5) / restitution == doctest::Approx(1).epsilon(0.03));
      CHECK(worst < 5e-3);
    }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: what moves pushes at its speed, and a belt and a turntable drag (long)") {
  for (const std::string mode : {"node", "cpu-double", "newton"}) {
    CAPTURE(mode);
    {
      Setup setup;
      // What is soft would leap from an impact: it goes ahead already, and the floor brakes it.
      const bool soft = mode == "newton";
      add(setup, slab, {soft ? -0.01 : 0, 0.1, 0}, glm::dmat3(1), {soft ? 0.5 : 0, 0, 0});
      Obstacle floor = half_space({0, 1, 0}), pusher = box({0.2, 0.5, 0.5}, {-0.41, 0.55, 0});
      pusher.velocity = {0.5, 0, 0};
      floor.friction = soft ? 0.3 : 0, pusher.friction = 0;
      setup.model->obstacles = {floor, pusher};
      in_mode(setup, mode);
      setup.settings.constraint_damping = setup.settings.material == "none" ? 0 : 2e-3;
      const Sim sim = run(setup, 120);
      const State end = read_state(sim);
      CHECK(centre_of(*setup.model, end.velocities).x == doctest::Approx(0.5).epsilon(0.02));
      CHECK(centre_of(*setup.model, end.positions).x == doctest::Approx(-0.01 + 0.5 * 0.6).epsilon(0.02));
      CHECK(deepest(sim) < 5e-3);
    }
    {
      Setup setup;
      add(setup, slab, {0, 0.1, 0});
      Obstacle belt = half_space({0, 1, 0});
      belt.velocity = {1, 0, 0};
      setup.model->obstacles = {belt};
      in_mode(setup, mode);
      const Sim sim = run(setup, 100);
      // Pulled by mu g to the belt's speed.
      const double time = 1 / (0.5 * 9.81), way = 0.5 * time + (0.5 - time);
      const State end = read_state(sim);
      CHECK(centre_of(*setup.model, end.velocities).x == doctest::Approx(1).epsilon(0.02));
      CHECK(centre_of(*setup.model, end.positions).x == doctest::Approx(way).epsilon(0.02));
    }
    {
      Setup setup;
      add(setup, slab, {0.5, 0.1, 0}, glm::dmat3(1), {0, 0, -1});  // at the speed of the plate there
      Obstacle plate = round_shape("cylinder", 2, 0.5, {0, -0.5, 0});
      plate.spin = {0, 2, 0}, plate.friction = 1;
      setup.model->obstacles = {plate};
      in_mode(setup, mode);
      const Sim sim = run(setup, 100);
      const glm::dvec3 end = centre_of(*setup.model, read_state(sim).positions);
      CHECK(glm::length(end - glm::dvec3(0.5 * std::cos(1), end.y, -0.5 * std::sin(1))) < 0.02);
    }
  }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: nothing goes through a plate as thick as an edge at 50 m/s (long)") {
  for (const std::string mode : {"node 20", "node 1", "explicit", "newton", "cpu", "cpu-fast", "constraint"}) {
    CAPTURE(mode);
    Setup setup;
    add(setup, slab, {0, 0.5, 0}, glm::dmat3(1), {0, -50, 0});
    setup.model->obstacles = {box({0.5, 0.05, 0.5}, {0, -0.05, 0})};
    in_mode(setup, mode.substr(0, mode.find(' ')));
    if (mode == "node 20") setup.settings.iterations = 20, setup.settings.substeps = 1;
    Sim sim = create_sim(setup.model, setup.settings);
    double lowest = 1, worst = 0;
    for (int s = 0; s < 30; ++s) {
      step(sim);
      for (const glm::dvec3& x : read_state(sim).positions)
        if (std::abs(x.x) < 0.5 && std::abs(x.z) < 0.5) lowest = std::min(lowest, x.y);
      worst = std::max(worst, deepest(sim));
    }
    CHECK(!check_finite(sim, true));
    CHECK(lowest > -0.05);
    CHECK(worst < 5e-3);
  }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: the GPU steps as the same method in double, and to the same bits again") {
  for (const Obstacle& o : every_shape()) {
    CAPTURE(o.kind->name);
    Setup setup;
    add(setup, ball_mesh(0.25), {0.1, 0.7 + 0.27, 0.05}, glm::dmat3(1), {0.5, -3, 0.2});
    Obstacle moving = o;
    moving.velocity = {0.3, 0.5, 0}, moving.spin = {0, 0, 2};
    setup.model->obstacles = {moving};
    setup.settings.rigid_contact = false;
    Sim sim = create_sim(setup.model, setup.settings), again = create_sim(setup.model, setup.settings);
    double worst = 0;
    for (int s = 0; s < 40; ++s) {
      const State one = samples::reference_after(sim, 1, Sweep::jacobi);
      step(sim), step(again);
      worst = std::max(worst, samples::distance(one, read_state(sim)));
    }
    CHECK(worst < 2e-5);
    CHECK(state_hash(sim) == state_hash(again));
  }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: time goes with the state: back, anew, and at another dt") {
  for (const char* mode : {"node", "cpu-fast"}) {
    CAPTURE(mode);
    Setup setup;
    add(setup, slab, {0, 0.12, 0});
    Obstacle lift = box({1, 0.5, 1}, {0, -0.5, 0});
    lift.keyframes = {{0.1, {0, -0.4, 0}, {0, 0, 10}}, {0.3, {0, -0.5, 0}, {0, 90, 0}}};
    setup.model->obstacles = {lift};
    in_mode(setup, mode);
    Sim sim = create_sim(setup.model, setup.settings);
    for (int s = 0; s < 15; ++s) step(sim);
    Buffer buffer("kept", std::max<std::size_t>(snapshot_bytes(sim), 4));
    const Snapshot kept = take_snapshot(sim, buffer, 0);
    for (int s = 0; s < 15; ++s) step(sim);
    const auto hash = state_hash(sim);
    restore_snapshot(sim, kept, buffer);
    for (int s = 0; s < 15; ++s) step(sim);
    CHECK(state_hash(sim) == hash);
    reset(sim);
    for (int s = 0; s < 30; ++s) step(sim);
    CHECK(state_hash(sim) == hash);
    Settings slower = sim.settings;
    slower.dt = 0.01;
    apply_settings(sim, slower);
    CHECK(simulated_time(sim) == doctest::Approx(0.15));
    step(sim);
    CHECK(simulated_time(sim) == doctest::Approx(0.16));
  }
  const Pose pose = pose_at(
      [] {
        Obstacle o = box({1, 1, 1});
        o.keyframes = {{1, {2, 0, 0}, {0, 0, 90}}};
        return o;
      }(),
      0.5);
  CHECK(pose.centre == glm::dvec3(1, 0, 0));
  CHECK(pose.axes[0].y == doctest::Approx(std::sqrt(0.5)));
}

TEST_CASE_FIXTURE(GlTest, "obstacles: references meet them too") {
  Setup setup;
  add(setup, slab, {0, 0.35, 0});
  Obstacle belt = box({3, 0.5, 1}, {0, -0.5, 0});
  belt.velocity = {0.2, 0, 0};
  setup.model->obstacles = {belt};
  RigidBody body = rigid_bodies(*setup.model).at(0);
  for (int s = 0; s < 6000; ++s) advance(body, *setup.model, setup.settings, 1e-4);
  CHECK(body.centre.y == doctest::Approx(0.1).epsilon(1e-3));
  CHECK(body.velocity.x == doctest::Approx(0.2).epsilon(1e-3));
  const Sim hard = run(setup, 120);
  CHECK(glm::length(centre_of(*setup.model, read_state(hard).positions) - body.centre) < 2e-3);

  Setup soft;
  add(soft, ball_mesh(0.25), {0, 0.3, 0});
  soft.model->obstacles = {round_shape("sphere", 0.6, 0, {0, -0.6, 0}), belt};
  soft.model->obstacles[1].centre.y = -0.6;
  in_mode(soft, "explicit");
  soft.settings.young_modulus = 1e5, soft.settings.constraint_damping = 2e-3;
  const Sim sim = create_sim(soft.model, soft.settings);
  const ReferenceInput input{*sim.model, sim.system, sim.settings, sim.inverse_masses};
  const State start{soft.model->positions, soft.model->velocities};
  Leapfrog leaps = leapfrog(input, sim.settings.compliance, start, 5e-5);
  Implicit implicits = implicit(input, sim.settings.compliance, start, 1e-3);
  advance(leaps, 3000), advance(implicits, 150);
  const double apart = samples::distance(make_state(leaps), make_state(implicits));
  CHECK(apart < 5e-3);
  CHECK(-still(soft.model->obstacles[0]).surface_at(make_state(leaps).positions[2]).distance < 1e-4);
}

TEST_CASE_FIXTURE(GlTest, "obstacles: penetration is measured over planes and shapes") {
  Setup setup;
  add(setup, slab, {0, 0.1, 0});
  setup.model->obstacles = {box({1, 0.5, 1}, {0, -0.49, 0})};
  const Sim sim = create_sim(setup.model, setup.settings);
  Metrics metrics = create_metrics(*sim.model);
  const Measurement now = measure_now(metrics, sim);
  CHECK(now.penetration_max == doctest::Approx(0.01 / setup.model->size));
  CHECK(now.penetration_999 == doctest::Approx(0.01 / setup.model->size).epsilon(0.5));
  CHECK(now.contacts == 25);
}

TEST_CASE_FIXTURE(GlTest,
                  "obstacles: half spaces beyond the planes of a step stop bodies too, and too many are refused") {
  for (const char* mode : {"node", "cpu-double"}) {
    CAPTURE(mode);
    Setup setup;
    add(setup, slab, {0, 0.2, 0});
    for (int k = 0; k < 12; ++k) setup.model->obstacles.push_back(half_space({0, 1, 0}, 0.005 * k));
    CHECK(solid_obstacles(*setup.model).size() == 13 - MAX_PLANES);
    in_mode(setup, mode);
    const State end = read_state(run(setup, 60));
    CHECK(bounds(end.positions).low.y == doctest::Approx(0.055).epsilon(1e-3));  // on the highest, the last
  }
  Setup setup;
  add(setup, slab, {0, 0.2, 0});
  setup.model->obstacles.resize(MAX_OBSTACLES, half_space({0, 1, 0}));
  CHECK_THROWS_WITH_AS(create_sim(setup.model, setup.settings),
                       doctest::Contains("too many obstacles: 31 of them: at most 30 beside the ground"), Error);
}

TEST_CASE_FIXTURE(GlTest, "obstacles: others are taken over without new kernels where these would be the same (long)") {
  for (const char* mode : {"node", "newton", "cpu-double", "cpu-fast"}) {
    CAPTURE(mode);
    Setup setup;
    add(setup, slab, {0, 0.1, 0});
    setup.model->obstacles = {half_space({0, 1, 0}), box({1, 0.5, 1}, {0, -0.7, 0})};
    in_mode(setup, mode);
    Sim sim = create_sim(setup.model, setup.settings);
    for (int s = 0; s < 10; ++s) step(sim);
    const GLuint buffer = sim.positions.id();  // that of another simulation, where it is made again
    auto other = std::make_shared<Model>(*setup.model);
    other->obstacles = {half_space({0, 1, 0}, -0.1), half_space({1, 0, 0}, -5), box({1, 0.5, 1}, {0, -0.58, 0})};
    change_obstacles(sim, other);
    setup.model.reset();  // nothing reads it any more
    CHECK(sim.positions.id() == buffer);
    Settings grounded = sim.settings;
    grounded.ground = true, grounded.ground_height = -5;
    apply_settings(sim, grounded);
    CHECK(sim.positions.id() == buffer);
    for (int s = 0; s < 60; ++s) step(sim);
    CHECK(bounds(read_state(sim).positions).low.y == doctest::Approx(-0.08).epsilon(0.05));  // now on the box
    auto ball = std::make_shared<Model>(*other);
    ball->obstacles.back() = round_shape("sphere", 1, 0, {0, -1.2, 0});  // a distance that these kernels lack
    change_obstacles(sim, ball);
    CHECK(sim.positions.id() != buffer);
    CHECK(sim.model == ball);
    CHECK(!check_finite(sim, true));
  }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: any shapes anywhere leave numbers finite (long)") {
  std::mt19937 random(seed_of_run(3));
  for (int round = 0; round < (is_long_run() ? 40 : 4); ++round) {
    CAPTURE(round);
    Setup setup;
    add(setup, ball_mesh(0.3), within(random, 0.5), glm::dmat3(1), within(random, 30));
    for (Obstacle o : every_shape()) {
      o.centre = within(random, 0.8), o.rotation = within(random, 180);
      o.velocity = within(random, 5), o.spin = within(random, 20);
      if (unit(random) < 0.4) setup.model->obstacles.push_back(o);
    }
    in_mode(setup, std::array{"node", "newton", "explicit", "cpu-fast"}[std::size_t(round % 4)]);
    if (round % 3 == 0) setup.settings.substeps = 1;
    Sim sim = run(setup, 25);
    CHECK(!check_finite(sim, true));
  }
}

TEST_CASE_FIXTURE(GlTest, "obstacles: scenes say them and say them again, what is wrong is refused") {
  const auto file = std::filesystem::temp_directory_path() / ("tetpbd_obstacles_" + std::to_string(getpid()) + ".json");
  const auto load = [&](const std::string& obstacles) {
    std::ofstream(file) << R"({"bodies": [{"block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "position": [0, 1, 0]}],
      "world": {"obstacles": [)"
                        << obstacles << "]}}";
    return load_scene(file.string());
  };
  const std::string all = R"({"point": [0, 0, 0], "normal": [0, 1, 0]},
    {"normal": [1, 3, 0], "friction": 0.2, "velocity": [1, 0, 0]},
    {"shape": "sphere", "centre": [1, 0, 0], "radius": 0.5, "restitution": 0.5},
    {"shape": "capsule", "centre": [0, 0.9, 0], "radius": 0.2, "half_length": 0.5, "spin": [0, 1, 0]},
    {"shape": "cylinder", "radius": 0.2, "half_length": 0.5, "rotation": [90, 0, 0]},
    {"shape": "box", "half": [1, 0.1, 1], "keyframes": [{"time": 0.1, "centre": [0, 0.1, 0]}, {"time": 1, "rotation": [0, 0, 30]}]},
    {"shape": "height-field", "half": [1, 0.2, 1], "heights": [[0, 0.5], [1, 0.1], [0.2, 0.3]]})";
  const Scene scene = load(all);
  const auto model = build_model(scene);
  CHECK(model->obstacles.size() == 7);
  CHECK(solid_obstacles(*model).size() == 6);
  Sim sim = create_sim(model, scene.settings);
  for (int s = 0; s < 20; ++s) step(sim);
  const auto written = scene_json(scene);
  std::ofstream(file) << written.dump();
  const Scene again = load_scene(file.string());
  CHECK(scene_json(again) == written);
  Sim replay = create_sim(build_model(again), again.settings);
  for (int s = 0; s < 20; ++s) step(replay);
  CHECK(state_hash(sim) == state_hash(replay));
  const auto error_of = [&](const std::string& obstacle) {
    try {
      build_model(load(obstacle));
    } catch (const Error& error) {
      CHECK(std::string(error.what()).find('\n') == std::string::npos);
      return std::string(error.what());
    }
    return std::string();
  };
  for (const auto& [text, word] : std::initializer_list<std::pair<std::string, const char*>>{
           {R"({"shape": "spere", "radius": 1})", "sphere"},
           {R"({"shape": "sphere"})", "radius"},
           {R"({"shape": "sphere", "radius": -1})", "radius"},
           {R"({"shape": "sphere", "radius": 1, "half": [1, 1, 1]})", "half"},
           {R"({"shape": "box", "half": [1, 1]})", "three numbers"},
           {R"({"normal": [0, 0, 0]})", "normal"},
           {R"({"point": [0, 0, 0]})", "normal"},
           {R"({"shape": "mesh", "mesh": "no.obj"})", "no.obj"},
           {R"({"shape": "height-field", "half": [1, 1, 1]})", "heights"},
           {R"({"shape": "height-field", "half": [1, 1, 1], "image": "no.png"})", "no.png"},
           {R"({"shape": "height-field", "half": [1, 1, 1], "heights": [[0, 1, 0], [0, 1]]})", "same length"},
           {R"({"shape": "box", "half": [1, 1, 1], "spin": [0, 1, 0], "keyframes": [{"time": 1}]})", "keyframes"},
           {R"({"shape": "box", "half": [1, 1, 1], "keyframes": [{"time": 1}, {"time": 1}]})", "keyframes.1.time"}}) {
    CAPTURE(text);
    CHECK(error_of(text).find(word) != std::string::npos);
  }
  std::filesystem::remove(file);
}

TEST_CASE_FIXTURE(GlTest, "obstacles: many substeps of what moves need no more memory, and meet the same (long)") {
  const auto run = [](const char* mode, int substeps, int steps) {
    Setup setup;
    add(setup, slab, {0, 0.12, 0});
    Obstacle lift = box({1, 0.5, 1}, {0, -0.5, 0});
    lift.velocity = {0, 0.5, 0};
    setup.model->obstacles = {lift};
    in_mode(setup, mode);
    setup.settings.iterations = 1, setup.settings.gravity = 0;
    setup.settings.substeps = substeps, setup.settings.dt = 0.1 / steps;
    Sim sim = create_sim(setup.model, setup.settings);
    for (int s = 0; s < steps; ++s) step(sim);
    CHECK(sim.obstacles.records.bytes() <= 1 << 18);
    return read_state(sim).positions;
  };
  for (const char* mode : {"node", "cpu", "cpu-fast"}) {
    CAPTURE(mode);
    const auto at_once = run(mode, 6000, 1), one_by_one = run(mode, 100, 60);
    double worst = 0;
    for (std::size_t i = 0; i < at_once.size(); ++i) worst = std::max(worst, glm::distance(at_once[i], one_by_one[i]));
    CHECK(worst < 1e-5);
  }
}

TEST_CASE("obstacles: no way is so long that a plate of two cells is stepped over") {
  Obstacle plate;
  plate.kind = find_obstacle_kind("mesh");
  auto field = std::make_shared<DistanceField>();
  field->spacing = 0.01, field->size = {41, 9, 41}, field->origin = {-0.2, -0.04, -0.2};
  for (int k = 0; k < 41; ++k)
    for (int j = 0; j < 9; ++j)
      for (int i = 0; i < 41; ++i) field->values.push_back(float(std::abs(j - 4) * 0.01 - 0.01));
  plate.field = field;
  const MovingObstacle shape = still(plate);
  int missed = 0;
  for (int k = 0; k < 200; ++k)
    for (const double length : {1.5, 5.0, 500.0}) {
      const glm::dvec3 from(-1 - 0.003 * k, 1 + 0.002 * k, 0.001 * k);
      missed += !(shape.surface_met(from * (1 - length), -from * length).distance < 0);
    }
  CHECK(missed == 0);
}
