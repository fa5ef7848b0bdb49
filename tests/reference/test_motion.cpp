// The reference motions of reference/: rigid bodies and leapfrog against closed forms, each other and implicit
// Euler.
#include <fstream>
#include <glm/gtc/matrix_transform.hpp>
#include <nlohmann/json.hpp>

#include "sim/model/material.h"
#include "sim/reference/implicit.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/motion.h"
#include "sim/reference/rigid.h"
#include "tests/app/run_program.h"
#include "tests/reference/reference_scenes.h"
#include "tests/sim_samples.h"

using namespace reference_scenes;
using namespace run_program;
using nlohmann::json;

namespace {

// A block at rest, its centre at `centre`, turned, thrown.
Scene block_at(const glm::dvec3& size, const glm::dvec3& centre, const glm::dvec3& velocity = glm::dvec3(0),
               const glm::dvec3& spin = glm::dvec3(0), const glm::dmat3& rotation = glm::dmat3(1)) {
  Scene scene;
  const TetMesh mesh = make_block(size, {2, 2, 2});
  const glm::dvec3 middle = bounds(mesh.positions).centre();
  std::vector<glm::dvec3> start;
  for (const glm::dvec3& p : mesh.positions) start.push_back(centre + rotation * (p - middle));
  add_body(scene.model, "block", mesh, 1000, start, velocity, spin, {});
  scene.system = build_constraints(scene.model.rest, scene.settings.constraints);
  return scene;
}

RigidBody rigid_of(const Scene& scene) { return rigid_bodies(scene.model).at(0); }

double energy_of(const RigidBody& b, double gravity) {
  const glm::dvec3 local = glm::transpose(b.rotation) * b.angular;
  return 0.5 * b.mass * glm::dot(b.velocity, b.velocity) + 0.5 * glm::dot(local, glm::inverse(b.inertia) * local) +
         b.mass * gravity * b.centre.y;
}

}  // namespace

// ----------------------------------------------------------------------------------------------------------
// rigid bodies

TEST_CASE("motion: a rigid block tumbles by Euler's equations and falls by a parabola") {
  Scene scene = block_at({1, 0.6, 0.3}, {0, 9, 0}, {1, 2, 3}, {0.1, 6, 0.05});
  scene.settings.ground = false;
  RigidBody b = rigid_of(scene);
  // I w' = (I w) x w in the block's own axes, by Runge-Kutta.
  const glm::dmat3 inertia = b.inertia, inverse = glm::inverse(inertia);
  glm::dvec3 w = inverse * b.angular;
  const auto rate = [&](const glm::dvec3& o) { return inverse * glm::cross(inertia * o, o); };
  const double h = 1e-4;
  const int steps = 20000;
  for (int s = 0; s < steps; ++s) {
    advance(b, scene.model, scene.settings, h);
    const glm::dvec3 k1 = rate(w), k2 = rate(w + h / 2 * k1), k3 = rate(w + h / 2 * k2), k4 = rate(w + h * k3);
    w += h / 6 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }
  const glm::dvec3 local = inverse * (glm::transpose(b.rotation) * b.angular);
  CHECK(glm::length(local - w) < 1e-4 * glm::length(w));
  CHECK(local.y < 0);  // about its middle axis it has turned over
  const double t = steps * h;
  CHECK(glm::length(b.centre - (glm::dvec3(0, 9, 0) + t * glm::dvec3(1, 2, 3) - glm::dvec3(0, 0.5 * 9.81 * t * t, 0))) <
        1e-9);
  CHECK(glm::length(glm::transpose(b.rotation) * b.rotation[0] - glm::dvec3(1, 0, 0)) < 1e-12);
}

TEST_CASE("motion: a rigid block on a slope slides by g (sin - friction cos) t^2 / 2, or sticks") {
  for (const double degrees : {25.0, 28.0}) {
    CAPTURE(degrees);
    const double angle = degrees * pi / 180;
    const glm::dvec3 normal(-std::sin(angle), std::cos(angle), 0), down(-std::cos(angle), -std::sin(angle), 0);
    const glm::dmat3 rotation(-down, normal, glm::dvec3(0, 0, 1));
    Scene scene = block_at({1, 0.2, 0.6}, 0.1 * normal, glm::dvec3(0), glm::dvec3(0), rotation);
    scene.settings.ground = false;
    scene.settings.friction = 0.5;
    scene.model.obstacles = {samples::half_space(normal)};
    RigidBody b = rigid_of(scene);
    const double h = 1e-3, t = 0.5;
    for (int s = 0; s < 500; ++s) advance(b, scene.model, scene.settings, h);
    const double travelled = glm::dot(b.centre - 0.1 * normal, down);
    const double pull = 9.81 * (std::sin(angle) - 0.5 * std::cos(angle));
    if (pull > 0)
      CHECK(travelled == doctest::Approx(pull * t * t / 2).epsilon(0.005));
    else
      CHECK(std::abs(travelled) < 1e-5);
    CHECK(std::abs(glm::dot(b.centre, normal) - 0.1) < 1e-4);
  }
}

TEST_CASE("motion: a rigid block bounces to the square of its restitution of the height, and without it rests") {
  for (const double restitution : {0.0, 0.5, 0.9}) {
    CAPTURE(restitution);
    Scene scene = block_at({1, 0.2, 0.6}, {0, 1.1, 0});  // lands flat, its lower side 1 m up
    scene.settings.restitution = restitution;
    RigidBody b = rigid_of(scene);
    const double h = 1e-4;
    double apex = 0, before = energy_of(b, 9.81);
    bool hit = false;
    for (int s = 0; s < 9000; ++s) {
      const double speed = b.velocity.y;
      advance(b, scene.model, scene.settings, h);
      hit = hit || b.velocity.y > speed;
      if (hit) apex = std::max(apex, b.centre.y);
      const double now = energy_of(b, 9.81);
      CHECK(now <= before + 1e-6 * b.mass);
      before = now;
    }
    CHECK(hit);
    CHECK(apex - 0.1 == doctest::Approx(restitution * restitution).epsilon(0.005).scale(0.2));
    if (restitution == 0) CHECK(glm::length(b.velocity) < 1e-9);
  }
}

TEST_CASE("motion: a tumbling block loses energy only, and comes to rest on the ground") {
  Scene scene = block_at({1, 0.6, 0.3}, {0, 1.5, 0}, {1, 0, 0.5}, {2, 3, 5});
  RigidBody b = rigid_of(scene);
  double before = energy_of(b, 9.81), rise = 0;
  for (int s = 0; s < 40000; ++s) {
    advance(b, scene.model, scene.settings, 1e-4);
    const double now = energy_of(b, 9.81);
    rise = std::max(rise, now - before);
    before = now;
  }
  CHECK(rise < 1e-5 * b.mass * 9.81);
  const double potential = b.mass * 9.81 * b.centre.y;
  CHECK(before - potential < 1e-9 * b.mass * 9.81);
  CHECK(b.centre.y == doctest::Approx(0.15).epsilon(0.002));  // on its largest side
}

TEST_CASE("motion: a corner that hits turns the body by its arm times the impulse, and stops") {
  const glm::dmat3 tilted(glm::rotate(glm::dmat4(1), 0.7, glm::normalize(glm::dvec3(1, 0.5, 2))));
  for (const double friction : {0.0, 0.4}) {
    CAPTURE(friction);
    Scene scene = block_at({1, 0.6, 0.3}, {0, 1, 0}, {0.3, -2, 0}, {1, 2, 3}, tilted);
    scene.settings.friction = friction;
    RigidBody b = rigid_of(scene), before = b;
    while (b.velocity.y < before.velocity.y || b.centre.y > 0.95)
      before = b, advance(b, scene.model, scene.settings, 1e-5);
    const auto lowest = std::ranges::min(b.rest, {}, [&](const glm::dvec3& r) { return (b.rotation * r).y; });
    const glm::dvec3 arm = b.rotation * lowest;
    const glm::dvec3 impulse = b.mass * (b.velocity - before.velocity + glm::dvec3(0, 1e-5 * 9.81, 0));
    CHECK(glm::length(b.angular - before.angular - glm::cross(arm, impulse)) < 1e-4 * glm::length(impulse));
    const glm::dvec3 spin = b.rotation * (glm::inverse(b.inertia) * (glm::transpose(b.rotation) * b.angular));
    CHECK(std::abs((b.velocity + glm::cross(spin, arm)).y) < 1e-3);
    const double slip = std::hypot(impulse.x, impulse.z);
    CHECK(slip <= friction * impulse.y + 1e-9);
    if (friction > 0) CHECK(slip > 0.1 * impulse.y);
  }
}

TEST_CASE("motion: a rigid block that three fixed vertices hold stays, on a line they leave it free to turn") {
  Scene scene = block_at({1, 1, 1}, {0, 2, 0});
  scene.model.inverse_masses[0] = scene.model.inverse_masses[1] = scene.model.inverse_masses[2] = 0;  // an edge
  CHECK_THROWS_WITH_AS(find_motion(scene.input(), 5), doctest::Contains("can turn about its fixed vertices"), Error);
  scene.model.inverse_masses[3] = 0;
  const Motion motion = find_motion(scene.input(), 5);
  CHECK(motion.method == "rigid body");
  REQUIRE(motion.kept.back() == 5);
  for (const auto& positions : motion.positions) CHECK(largest_distance(positions, scene.model.positions) < 1e-12);
  CHECK(motion.rows.back().kinetic == 0);
  scene.model.velocities[5].x = 1;
  CHECK_THROWS_AS(find_motion(scene.input(), 5), Error);  // cannot set off
}

TEST_CASE("motion: what is no rigid motion is refused") {
  Scene scene = block_at({1, 1, 1}, {0, 2, 0});
  scene.model.positions[0].x += 0.01;
  CHECK_THROWS_AS(rigid_bodies(scene.model), Error);
  scene = block_at({1, 1, 1}, {0, 2, 0});
  scene.model.inverse_masses[0] = 0;
  CHECK_THROWS_AS(rigid_bodies(scene.model), Error);
  scene = block_at({1, 1, 1}, {0, 2, 0});
  scene.settings.stiffness[index_of<Bend>] = 0.5;
  CHECK_THROWS_AS(find_motion(scene.input(), 1), Error);
  scene.settings.stiffness[index_of<Bend>] = 1;
  scene.settings.compliance[index_of<Stretch>] = 1e-4;
  CHECK_THROWS_AS(find_motion(scene.input(), 1), Error);  // of some kinds only
}

// ----------------------------------------------------------------------------------------------------------
// leapfrog

TEST_CASE("motion: the longest stable step is that of the fastest vibration, damped or not") {
  Scene scene = chain_scene({{0, 0, 0}, {1, 0, 0}}, {1 / 2.0, 1 / 3.0});
  const double alpha = 1e-4, omega = std::sqrt((1 / 2.0 + 1 / 3.0) / alpha);
  const Compliances compliances{alpha, infinity, infinity};
  CHECK(stable_step(scene.input(), compliances, scene.model.positions) == doctest::Approx(2 / omega).epsilon(0.02));
  const double tau = scene.settings.constraint_damping = 0.01;
  const double limit = (std::sqrt(tau * tau * omega * omega + 4) - tau * omega) / omega;
  CHECK(stable_step(scene.input(), compliances, scene.model.positions) == doctest::Approx(limit).epsilon(0.02));
  // A little below it the spring swings, a little above it does not stay finite.
  scene.settings.gravity = 0;
  for (const double part : {0.95, 1.05}) {
    State start{scene.model.positions, scene.model.velocities};
    start.positions[1].x += 1e-6;
    Leapfrog run = leapfrog(scene.input(), compliances, start, part * limit);
    advance(run, 400);
    CHECK((std::abs(run.x[1].x - run.x[0].x - 1) < 1e-5) == (part < 1));
  }
}

TEST_CASE("motion: two masses on a spring fall, stick, and leave the ground when the spring pulls enough") {
  // Masses m below and above, spring k. After the impact the lower one is held while the spring pushes; the
  // upper one swings about its equilibrium with the speed it came with, and lifts the lower one where k
  // stretch = m g.
  const double m = 1, k = 400, g = 9.81, drop = 0.5, alpha = 1 / k, omega = std::sqrt(k / m);
  Scene scene = chain_scene({{0, drop, 0}, {0, drop + 1, 0}}, {1 / m, 1 / m});
  scene.settings.ground = true;
  const double fall = std::sqrt(2 * drop / g), speed = -g * fall, sag = m * g / k;
  // Above equilibrium by s: s = sag cos(w t) + speed / w sin(w t) from the moment of impact; the stretch is s
  // - sag.
  double lift = 0;
  const auto height = [&](double t) { return sag * std::cos(omega * t) + speed / omega * std::sin(omega * t); };
  while (height(lift) < 2 * sag || lift < pi / omega / 2) lift += 1e-6;
  const Compliances compliances{alpha, infinity, infinity};
  const auto lands_and_leaves = [&](auto run) {
    advance(run, std::lround((fall + 0.5 * lift) / run.h));
    Points x = make_state(run).positions;
    CHECK(x[0].y == doctest::Approx(0).epsilon(1e-6).scale(1));
    CHECK(x[1].y == doctest::Approx(1 - sag + height(0.5 * lift)).epsilon(1e-4));
    advance(run, std::lround(0.48 * lift / run.h));
    CHECK(make_state(run).positions[0].y < 1e-6);
    advance(run, std::lround(0.06 * lift / run.h));
    x = make_state(run).positions;
    CHECK(x[0].y > 1e-6);
    CHECK(x[0].x == 0);
  };
  lands_and_leaves(leapfrog(scene.input(), compliances, scene.start(), 2e-5));
  lands_and_leaves(implicit(scene.input(), compliances, scene.start(), 2e-5));
}

TEST_CASE("motion: soft bodies slide v^2 / (2 friction g) and stop") {
  Scene scene = chain_scene({{0, 0, 0}, {1, 0, 0}}, {1, 1});
  scene.settings.ground = true;
  scene.settings.friction = 0.5;
  const State start{scene.model.positions, {{1, 0, 0}, {1, 0, 0}}};
  const auto slides_and_stops = [](auto run, double creep) {
    advance(run, std::lround(0.3 / run.h));
    const double stopped = make_state(run).positions[0].x;
    CHECK(stopped == doctest::Approx(1 / (2 * 0.5 * 9.81)).epsilon(0.005));
    advance(run, std::lround(0.1 / run.h));
    CHECK(std::abs(make_state(run).positions[0].x - stopped) <= creep);
  };
  const Compliances compliances{1e-4, infinity, infinity};
  slides_and_stops(leapfrog(scene.input(), compliances, start, 1e-4), 1e-9);
  slides_and_stops(implicit(scene.input(), compliances, start, 1e-4), 1e-7);  // below 1e-6 m/s
}

TEST_CASE("motion: leapfrog is of second order, keeps momentum and energy, and is where implicit Euler goes") {
  const Scene scene = [] {
    Scene s = block_scene({2, 1, 1});
    s.settings.gravity = 0;
    return s;
  }();
  const Compliances compliances{1e-4, 1e-1, 1e-7};
  const State start = scene.start();
  const auto after = [&](double h) {
    Leapfrog run = leapfrog(scene.input(), compliances, start, h);
    advance(run, std::lround(0.02 / h));
    return make_state(run);
  };
  const double stable = stable_step(scene.input(), compliances, scene.model.rest.positions);
  const double h = 0.02 / std::ceil(0.02 / (0.3 * stable));
  const State one = after(h), half = after(h / 2), quarter = after(h / 4);
  const double e1 = error_to(scene.model, quarter, one), e2 = error_to(scene.model, quarter, half);
  CHECK(e1 / e2 == doctest::Approx(5).epsilon(0.2));  // (1 - 1/16) / (1/4 - 1/16)
  CHECK(glm::length(centre_of(scene.model, quarter.velocities) - centre_of(scene.model, start.velocities)) < 1e-12);
  const Objective elastic = static_objective(scene.input(), start.positions, compliances);
  const auto total = [&](const State& s) {
    double kinetic = 0;
    for (std::size_t i = 0; i < s.velocities.size(); ++i)
      kinetic += 0.5 * scene.model.masses[i] * glm::dot(s.velocities[i], s.velocities[i]);
    return kinetic + energy(elastic, s.positions);
  };
  CHECK(total(quarter) == doctest::Approx(total(start)).epsilon(1e-4));
  // Another code path: implicit Euler by Newton, extrapolated twice to steps of no length.
  const auto implicit = [&](int substeps) {
    Scene s = scene;
    s.settings.dt = 0.02, s.settings.substeps = substeps;
    return implicit_euler_step(s.input(), start, compliances).state.positions;
  };
  const auto a = implicit(100), b = implicit(200), c = implicit(400);
  State limit = start;
  for (std::size_t i = 0; i < a.size(); ++i) limit.positions[i] = (8.0 * c[i] - 6.0 * b[i] + a[i]) / 3.0;
  const double moved = error_to(scene.model, {limit.positions, {}}, start);
  CHECK(error_to(scene.model, limit, quarter) < 1e-3 * moved);
}

TEST_CASE("motion: implicit steps, which share no line with the leapfrog, go where it goes") {
  // An irregular block of neo-hookean tets hits the ground aslant and slides; with and without damping.
  for (const double damping : {0.0, 0.002}) {
    CAPTURE(damping);
    Scene scene = block_scene({3, 2, 2});
    for (auto& p : scene.model.positions) p.y -= 1.05;
    scene.model.velocities.assign(scene.model.positions.size(), {2, -1, 0});
    scene.settings.friction = 0.5;
    scene.settings.constraint_damping = damping;
    scene.settings.material = "neo-hookean";
    scene.settings.young_modulus = 1e5, scene.settings.poisson_ratio = 0.4;
    scene.system = build_constraints(scene.model.rest, scene.settings);
    const double end = 0.4, stable = stable_step(scene.input(), none, scene.model.rest.positions);
    const long steps = std::lround(16 * end / stable);
    Leapfrog right = leapfrog(scene.input(), none, scene.start(), end / double(steps));
    advance(right, steps);
    const State answer = make_state(right);
    std::vector<double> errors;
    for (const long n : {80l, 320l}) {
      Implicit run = implicit(scene.input(), none, scene.start(), end / double(n));
      advance(run, n);
      errors.push_back(error_to(scene.model, answer, run.now));
    }
    CHECK(errors[0] < 0.006);
    CHECK(errors[1] < 0.0006);
    CHECK(errors[1] < 0.2 * errors[0]);  // first order would be 0.25, without contact it is 1/16
  }
}

TEST_CASE("motion: implicit steps in flight are of second order, with drag and constraint damping too") {
  Scene scene = block_scene({2, 1, 1});
  scene.settings.ground = false;
  scene.settings.damping = 3;
  scene.settings.constraint_damping = 0.002;
  const Compliances compliances{1e-4, 1e-1, 1e-7};
  const double end = 0.05, h = stable_step(scene.input(), compliances, scene.model.rest.positions) / 40;
  Leapfrog other = leapfrog(scene.input(), compliances, scene.start(), end / std::round(end / h));
  advance(other, std::lround(end / other.h));
  std::vector<State> states;
  for (const long n : {200l, 400l, 800l}) {
    Implicit run = implicit(scene.input(), compliances, scene.start(), end / double(n));
    advance(run, n);
    states.push_back(run.now);
  }
  const auto apart = [&](const State& a, const State& b) { return error_to(scene.model, a, b); };
  CHECK(apart(states[2], make_state(other)) < 1e-4);
  CHECK(apart(states[2], states[0]) / apart(states[2], states[1]) == doctest::Approx(5).epsilon(0.2));
}

TEST_CASE("motion: what is found states its own error, and does not depend on how the scene is solved") {
  Scene scene = block_scene({2, 1, 1});
  for (auto& p : scene.model.positions) p.y -= 1.1;
  const std::uint64_t key = scene_key(scene.input());
  scene.settings.iterations = 3, scene.settings.substeps = 7, scene.settings.mode = "cpu", scene.settings.omega = 1;
  CHECK(scene_key(scene.input()) == key);
  scene.settings.compliance = {1e-4, 1e-1, 1e-7};
  CHECK(scene_key(scene.input()) != key);
  const Motion motion = find_motion(scene.input(), 40);
  CHECK(motion.method == "leapfrog");
  scene.settings.constraint_damping = 1000;  // too short steps for an explicit method
  CHECK(find_motion(scene.input(), 1).method == "implicit");
  scene.settings.constraint_damping = 0;
  const Motion other = find_motion(scene.input(), 40, "implicit");
  CHECK(error_to(scene.model, {motion.positions.back(), {}}, {other.positions.back(), {}}) <
        motion.rows.back().error + 2 * other.rows.back().error);
  CHECK(other.rows.back().error < 2e-3);
  CHECK_THROWS_AS(find_motion(scene.input(), 1, "rigid body"), Error);
  CHECK(motion.rows.size() == 41);
  CHECK(motion.kept.front() == 0);
  CHECK(motion.kept.back() == 40);
  CHECK(motion.positions.size() == motion.kept.size());
  CHECK(motion.rows[20].error > 0);
  CHECK(motion.rows[20].error < 1e-3);
  double lowest = 1;
  for (const auto& positions : motion.positions)
    for (const glm::dvec3& p : positions) lowest = std::min(lowest, p.y);
  CHECK(lowest == doctest::Approx(0).epsilon(1e-9).scale(1));  // it has touched the ground
  MotionError error;
  for (long step : {0l, 20l, 40l}) {
    State state{motion.positions[std::size_t(step)], {}};
    for (auto& p : state.positions) p.x += 0.01 * scene.model.size * double(step) / 20;
    add_state(error, motion, scene.model, step, state);
  }
  CHECK(error.instants == 3);
  CHECK(error.final == doctest::Approx(0.02));
  CHECK(error.peak == doctest::Approx(0.02));
  CHECK(error.rms == doctest::Approx(std::sqrt(5e-4 / 3)));
}

// ----------------------------------------------------------------------------------------------------------
// the command

TEST_CASE("reference: a motion is kept, found by runs, taken up where it was, and refused for another scene") {
  const Folder folder;
  std::ofstream(folder.path / "soft.json")
      << R"({"bodies": [{"block": {"size": [0.4, 0.2, 0.2], "cells": [4, 2, 2]}, "position": [0, 0.02, 0]}],
             "solver": {"constraints": ["stretch", "volume"], "compliance_stretch": 1e-5,
                        "compliance_volume": 1e-10, "iterations": 1, "substeps": 5}, "duration": 0.1})";
  const std::string cache = "TETPBD_CACHE=" + (folder.path / "cache").string();  // not there yet
  const Outcome found = program("reference --scene soft.json", folder, cache);
  CHECK(found.err == "");
  REQUIRE(found.status == 0);
  CHECK(found.out.find("leapfrog") != std::string::npos);
  const auto motion_error = [&](const std::string& arguments) {
    REQUIRE(program("run --scene soft.json --out r --mode cpu-fast " + arguments, folder, cache).status == 0);
    return json::parse(read(folder.path / "r/stats.json"))["error"];
  };
  const json coarse = motion_error("--substeps 5"), fine = motion_error("--substeps 200");
  for (const char* key : {"motion_final", "motion_rms", "motion_peak", "motion_relative"}) {
    CHECK(fine[key].get<double>() > 0);
    CHECK(fine[key].get<double>() < 0.2 * coarse[key].get<double>());
  }
  CHECK(motion_error("--friction 0.1")["motion_final"].is_null());  // another scene, of which there is none

  // By name; and the same bits whether it was interrupted or not.
  const std::string stiff = "reference --scene soft.json --set solver.compliance_stretch=1e-8 --out ";
  for (const std::string name : {"a", "c"}) {
    const std::string method = name == "a" ? "" : " --method implicit";
    const Outcome stopped = program(stiff + name + " --steps 400" + method, folder, cache + " timeout -s INT 1");
    CHECK(stopped.status == 124);
    CHECK(stopped.err.find("interrupted") != std::string::npos);
    CHECK_FALSE(fs::exists(folder.path / name));
    REQUIRE(fs::exists(folder.path / (name + ".unfinished")));
  }
  fs::copy(folder.path / "a.unfinished", folder.path / "short.unfinished");
  REQUIRE(program(stiff + "short --steps 3", folder, cache).status == 0);  // what is longer is not taken up
  const std::string found_short = read(folder.path / "short");
  CHECK(json::parse(found_short.substr(0, found_short.find('\n')))["rows"].size() == 4);
  REQUIRE(program(stiff + "a --steps 400", folder, cache).status == 0);
  CHECK_FALSE(fs::exists(folder.path / "a.unfinished"));
  REQUIRE(program(stiff + "b --steps 400", folder, cache).status == 0);
  CHECK(read(folder.path / "a") == read(folder.path / "b"));
  const Outcome other = program("run --scene soft.json --reference a --out r", folder, cache);
  CHECK(other.status == 2);
  CHECK(other.err.find("the motion of another scene: a") != std::string::npos);
  CHECK(program("run --scene soft.json --reference soft.json --out r", folder, cache)
            .err.find("not the motion of a scene: soft.json") != std::string::npos);
  CHECK(program("reference --scene soft.json --k-volume 0.5", folder, cache)
            .err.find("the scene has no reference motion: k_volume is 0.5") != std::string::npos);
}
