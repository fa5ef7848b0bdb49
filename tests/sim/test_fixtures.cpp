// Fixed vertices that move along a path of the scene, in every mode.
#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "sim/measure/crossings.h"
#include "sim/measure/metrics.h"
#include "sim/sim.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"

using namespace tetpbd;
using namespace run_program;

namespace {

// A bar along y, whose lower end is fixed and whose upper end goes along `path`, from where it starts.
std::shared_ptr<Model> bar(Path path, const glm::ivec3& cells = {2, 12, 2}) {
  auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block({0.1, 0.8, 0.1}, cells, true);
  VertexList fixed, upper;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const double y = mesh.positions[v].y;
    if (std::abs(y) > 0.399) fixed.push_back(v);
    if (y > 0.399) upper.push_back(v);
  }
  add_body(*model, "bar", mesh, 1000, mesh.positions, {}, {}, fixed);
  path.centre = {0, 0.4, 0};
  for (Path::Key& key : path.keyframes) key.centre += path.centre;
  model->fixtures.push_back({0, 0, upper, path});
  return model;
}

Settings settings_of(const std::string& mode) {
  Settings s;
  s.mode = mode, s.gravity = 0, s.ground = false, s.dt = 0.005;
  s.material = "neo-hookean", s.young_modulus = 1e5, s.poisson_ratio = 0.3, s.constraint_damping = 0.005;
  if (!solver_mode(s).forces) s.substeps = 20;
  if (solver_mode(s).implicit) s.iterations = 8;
  return s;
}

// Degrees about y, of the vertices near a height at rest.
double turn_at(const Model& model, const State& state, double y) {
  double sum = 0;
  int count = 0;
  for (std::size_t v = 0; v < state.positions.size(); ++v) {
    const glm::dvec3 &rest = model.rest.positions[v], &x = state.positions[v];
    if (std::abs(rest.y - y) > 1e-6 || std::hypot(rest.x, rest.z) < 1e-6) continue;
    const double turn = std::atan2(rest.z, rest.x) - std::atan2(x.z, x.x);
    sum += std::remainder(turn, 2 * std::numbers::pi) * 180 / std::numbers::pi, ++count;
  }
  return sum / count;
}

}  // namespace

TEST_CASE_FIXTURE(GlTest, "fixtures: an end that turns twists a bar evenly, in every mode (long)") {
  const auto model = bar({.keyframes = {{0.4, {0, 0, 0}, {0, 60, 0}}}});
  for (const SolverMode& mode : solver_modes()) {
    if (mode.published) continue;
    CAPTURE(std::string(mode.name));
    Sim sim = create_sim(model, settings_of(mode.name));
    double lag = 0;
    for (int s = 0; s < 160; ++s) {
      step(sim);
      lag = std::max(lag, lag_of(sim, model->fixtures[0], read_state(sim)));
      if (s == 40) {  // half way
        CHECK(turn_at(*model, read_state(sim), 0.4) == doctest::Approx(60 * 0.205 / 0.4).epsilon(1e-4));
        const glm::dvec3 v = read_state(sim).velocities[model->fixtures[0].vertices[0]];
        CHECK(glm::length(v) ==
              doctest::Approx(std::hypot(0.05, 0.05) * 60 * std::numbers::pi / 180 / 0.4).epsilon(0.01));
      }
    }
    CHECK(lag < 1e-5);
    const State end = read_state(sim);
    CHECK(turn_at(*model, end, 0.4) == doctest::Approx(60).epsilon(1e-4));
    CHECK(turn_at(*model, end, 0) == doctest::Approx(30).epsilon(0.03));
    CHECK(glm::length(end.velocities[model->fixtures[0].vertices[0]]) < 1e-4);
  }
}

// The torque is the energy's derivative by the angle, 2 E over it where both are small.
TEST_CASE_FIXTURE(GlTest, "fixtures: a twisted bar resists with the torque of Saint-Venant (long)") {
  Settings settings = settings_of("newton");
  settings.iterations = 12, settings.dt = 0.01, settings.element = "smoothed", settings.constraint_damping = 0.01;
  const auto torque = [&](int across) {
    const auto model = bar({.keyframes = {{0.3, {0, 0, 0}, {0, 10, 0}}}}, {across, 8 * across, across});
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 60; ++s) step(sim);
    Metrics metrics = create_metrics(sim);
    return 2 * measure_now(metrics, sim).elastic / glm::radians(10.0);
  };
  const double coarse = torque(4), fine = torque(6), limit = fine + (fine - coarse) / (1.5 * 1.5 - 1);
  const double shear = settings.young_modulus / (2 * (1 + settings.poisson_ratio));
  const double right = shear * 0.1406 * std::pow(0.1, 4) * glm::radians(10.0) / 0.8;
  MESSAGE("over the right torque: ", coarse / right, " ", fine / right, ", extrapolated ", limit / right);
  CHECK(limit == doctest::Approx(right).epsilon(0.02));
}

TEST_CASE_FIXTURE(
    GlTest, "fixtures: one that goes at a speed pulls its body along, and what is in its way holds it back (long)") {
  auto model = std::make_shared<Model>();
  const TetMesh cube = make_block(glm::dvec3(0.2), glm::ivec3(3), true), wall = make_block({0.1, 0.5, 0.5}, {1, 4, 4});
  VertexList all, side;
  for (std::uint32_t v = 0; v < wall.positions.size(); ++v) all.push_back(v);
  for (std::uint32_t v = 0; v < cube.positions.size(); ++v)
    if (cube.positions[v].x < -0.0999) side.push_back(v);
  auto beyond = wall.positions;
  for (glm::dvec3& p : beyond) p.x += 0.35;
  add_body(*model, "cube", cube, 1000, cube.positions, {}, {}, side);
  add_body(*model, "wall", wall, 1000, beyond, {}, {}, all);
  model->fixtures.push_back({0, 0, side, {.centre = {-0.1, 0, 0}, .velocity = {1, 0, 0}}});
  for (const char* mode : {"explicit", "newton", "node", "cpu"}) {
    CAPTURE(mode);
    Settings settings = settings_of(mode);
    settings.contact = "bodies";
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 20; ++s) step(sim);
    CHECK(lag_of(sim, model->fixtures[0], read_state(sim)) < 1e-5);
    for (int s = 0; s < 80; ++s) step(sim);
    const State end = read_state(sim);
    CHECK(find_crossings(*model, end.positions, false).pairs == 0);
    CHECK(lag_of(sim, model->fixtures[0], end) > 0.1);  // 0.5 m on, with a wall at 0.2
    CHECK(end.positions[side[0]].x < 0.3);
  }
}

// Two stiff pads close on a soft block that lies on nothing, so that only friction holds it against its weight.
TEST_CASE_FIXTURE(GlTest,
                  "fixtures: pads hold a block above the friction that theory asks for, and drop it below (long)") {
  auto model = std::make_shared<Model>();
  const TetMesh block = make_block(glm::dvec3(0.2), glm::ivec3(3)), pad = make_block({0.05, 0.26, 0.26}, {1, 4, 4});
  add_body(*model, "block", block, 200, block.positions, {}, {}, {});
  for (const double side : {-1.0, 1.0}) {
    auto start = pad.positions;
    for (glm::dvec3& p : start) p.x += side * 0.15;
    VertexList all;
    for (std::uint32_t v = 0; v < pad.positions.size(); ++v) all.push_back(v);
    const auto first = std::uint32_t(model->positions.size());
    add_body(*model, "pad", pad, 1000, start, {}, {}, all);
    for (std::uint32_t& v : all) v += first;
    const Path path{.centre = {side * 0.15, 0, 0}, .keyframes = {{0.2, {side * 0.116, 0, 0}, {}}}};
    model->fixtures.push_back({model->bodies.size() - 1, 0, all, path});
  }
  constexpr double modulus = 2e4, area = 0.04;
  const auto held = [&](double friction, bool with_gravity) {
    Settings settings = settings_of("explicit");
    settings.contact = "bodies", settings.young_modulus = modulus, settings.poisson_ratio = 0, settings.damping = 4;
    settings.friction = friction;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 120; ++s) step(sim);
    settings.gravity = with_gravity ? 9.81 : 0;
    apply_settings(sim, settings);
    for (int s = 0; s < 80; ++s) step(sim);
    return read_state(sim);
  };
  const auto width = [&](const State& state) {
    double left = 0, right = 0;
    for (std::size_t v = 0; v < model->bodies[0].vertices; ++v) {
      if (model->rest.positions[v].x < -0.0999) left += state.positions[v].x / 16;
      if (model->rest.positions[v].x > 0.0999) right += state.positions[v].x / 16;
    }
    return right - left;
  };
  const double push = modulus * area * (1 - width(held(0.5, false)) / 0.2);
  const double least = body_mass(*model, model->bodies[0]) * 9.81 / (2 * push);
  MESSAGE("the pads push with ", push, " N, which holds from a friction of ", least, " on");
  REQUIRE(push > 20);
  const auto fallen = [&](double friction) {
    const State end = held(friction, true);
    double y = 0;
    for (std::size_t v = 0; v < model->bodies[0].vertices; ++v) y -= model->masses[v] * end.positions[v].y;
    return y / body_mass(*model, model->bodies[0]);
  };
  const double above = fallen(1.1 * least), below = fallen(0.9 * least);
  MESSAGE("a tenth above it falls ", above, " m, a tenth below ", below);
  CHECK(above < 0.02);
  CHECK(below > 0.05);
}

TEST_CASE("fixtures: a scene says how they move, and what is wrong with it") {
  const Folder folder;
  const auto run = [&](const std::string& fixed, const std::string& more = "") {
    std::ofstream(folder.path / "m.json") << R"({"bodies": [{"name": "bar", "block": {"size": [0.1, 0.8, 0.1],
      "cells": [1, 4, 1]}, "position": [1, 0.5, 0], "rotation": [0, 0, 90], "material": "foam",
      "fixed": [{"low": [0, 0, 0], "high": [1, 0, 1]}, {"low": [0, 1, 0], "high": [1, 1, 1], )"
                                          << fixed << R"(}]}], "world": {"gravity": 0, "ground": false}})";
    return program("run --scene m.json --mode cpu --steps 20 --positions --out r " + more, folder);
  };
  const Outcome moved =
      run(R"("keyframes": [{"time": 0.05, "move": [-0.1, 0, 0]}, {"time": 0.1, "rotation": [90, 0, 0]}])");
  CHECK_MESSAGE(moved.status == 0, moved.err);
  const auto stats = nlohmann::json::parse(read(folder.path / "r/stats.json"));
  REQUIRE(stats["fixtures"].size() == 1);
  CHECK(stats["fixtures"][0]["body"] == "bar");
  CHECK(stats["fixtures"][0]["fixed"] == 1);
  CHECK(stats["fixtures"][0]["lag"] < 1e-9);
  CHECK(stats["bodies"][0]["size"][0].get<double>() == doctest::Approx(0.9));  // the upper end points to -x
  CHECK(stats["energy"]["not_judged"] == "fixed vertices move, and their work is not measured");
  std::filesystem::copy(folder.path / "r/scene.json", folder.path / "again.json");
  CHECK(program("run --scene again.json --steps 20 --out s", folder).status == 0);
  CHECK(nlohmann::json::parse(read(folder.path / "s/stats.json"))["bodies"] == stats["bodies"]);
  // Against a wall that is fixed.
  std::ofstream(folder.path / "w.json") << R"({"bodies": [
    {"name": "cube", "block": {"size": [0.2, 0.2, 0.2], "cells": [2, 2, 2]}, "material": "foam",
     "fixed": [{"low": [0, 0, 0], "high": [0, 1, 1], "velocity": [2, 0, 0]}]},
    {"name": "wall", "block": {"size": [0.1, 0.4, 0.4], "cells": [1, 2, 2]}, "position": [0.3, -0.1, 0], "material": "foam",
     "fixed": [{"low": [0, 0, 0], "high": [1, 1, 1]}]}], "world": {"gravity": 0, "ground": false}})";
  const Outcome pressed = program("run --scene w.json --mode cpu --steps 60 --out w", folder);
  CHECK_MESSAGE(pressed.out.find("held back: fixed.0 of body 'cube' is 0.") != std::string::npos, pressed.out);
  const auto refused = [&](const std::string& fixed, const std::string& message) {
    const Outcome wrong = run(fixed);
    CHECK(wrong.status == 2);
    CHECK_MESSAGE(wrong.err.find(message) != std::string::npos, wrong.err);
  };
  refused(R"("keyframes": [{"time": 0.1}, {"time": 0.1}])", "'bodies.0.fixed.1.keyframes.1.time' must be later");
  refused(R"("keyframes": [{"time": 0.1}], "velocity": [1, 0, 0])", "already say how it moves");
  refused(R"("keyframes": [{"time": 0.1, "centre": [0, 0, 0]}])", "'bodies.0.fixed.1.keyframes.0.centre' is not known");
}
