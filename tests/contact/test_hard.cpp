// Hard bodies that touch each other: they move as rigid ones, as rigid-body mechanics has it.
#include <doctest/doctest.h>

#include <cmath>

#include "sim/contact/rigid_contact.h"
#include "sim/contact/starts.h"
#include "sim/measure/crossings.h"
#include "sim/sim.h"
#include "sim/snapshot.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

struct Block {
  glm::dvec3 centre, velocity{0}, rotation{0};
  glm::dvec3 size{0.4};
  double density = 1000;
  bool fixed = false;
};

std::shared_ptr<Model> model_of(const std::vector<Block>& blocks) {
  auto model = std::make_shared<Model>();
  for (const Block& block : blocks) {
    const TetMesh mesh = make_block(block.size, glm::ivec3(3), true);
    VertexList fixed;
    auto start = mesh.positions;
    for (std::uint32_t v = 0; v < start.size(); ++v) {
      start[v] = rotation_of(block.rotation) * start[v] + block.centre;
      if (block.fixed) fixed.push_back(v);
    }
    add_body(*model, "block", mesh, block.density, start, block.velocity, glm::dvec3(0), fixed);
  }
  return model;
}

// Five substeps of 1 ms a step.
Settings hard(const std::string& mode) {
  Settings s;
  s.mode = mode, s.contact = "bodies", s.dt = 0.005, s.substeps = 5, s.iterations = mode == "node" ? 2 : 10;
  s.friction = 0.5;
  return s;
}
Settings weightless(Settings s) {
  s.gravity = 0, s.ground = false, s.friction = 0;
  return s;
}

struct Motion {
  double mass = 0;
  glm::dvec3 centre{0}, velocity{0}, angular{0};  // angular: momentum about the origin
};
Motion motion_of(const Model& model, const State& state, std::size_t first, std::size_t count) {
  Motion m;
  for (std::size_t i = first; i < first + count; ++i) {
    const double mass = model.masses[i];
    m.mass += mass, m.centre += mass * state.positions[i], m.velocity += mass * state.velocities[i];
    m.angular += mass * glm::cross(state.positions[i], state.velocities[i]);
  }
  m.centre /= m.mass, m.velocity /= m.mass;
  return m;
}
std::vector<Motion> motions_of(const Model& model, const State& state) {
  std::vector<Motion> all;
  for (const Body& body : model.bodies) all.push_back(motion_of(model, state, body.first_vertex, body.vertices));
  return all;
}
double energy_of(const Model& model, const State& state, const Settings& settings) {
  double energy = 0;
  for (std::size_t i = 0; i < model.masses.size(); ++i)
    if (model.inverse_masses[i] > 0)
      energy += model.masses[i] *
                (0.5 * glm::dot(state.velocities[i], state.velocities[i]) + settings.gravity * state.positions[i].y);
  return energy;
}

struct Run {
  std::vector<Motion> motions;
  State state;
  std::size_t crossings = 0;
  double created = 0;  // J, the most that energy rose above its lowest
};
Run run(const std::shared_ptr<Model>& model, const Settings& settings, int steps) {
  separate_starts(*model, settings);
  Sim sim = create_sim(model, settings);
  Run result;
  double lowest = INFINITY;
  for (int s = 0; s < steps; ++s) {
    step(sim);
    result.state = read_state(sim);
    const double energy = energy_of(*model, result.state, settings);
    lowest = std::min(lowest, energy), result.created = std::max(result.created, energy - lowest);
    if (s % 5 == 4)
      result.crossings = std::max(result.crossings, find_crossings(*model, result.state.positions, false).pairs);
  }
  result.motions = motions_of(*model, result.state);
  return result;
}

const std::vector<std::string> two_modes = {"cpu-double", "node"},
                               all_modes = {"cpu-double", "cpu-fast", "node", "constraint"};

}  // namespace

TEST_CASE_FIXTURE(GlTest, "hard bodies: a stack of ten stands (long)") {
  for (const std::string mode : {"cpu-fast", "node"}) {
    CAPTURE(mode);
    std::vector<Block> blocks;
    for (int k = 0; k < 10; ++k) blocks.push_back({.centre = {0, 0.2 + 0.4221 * k, 0}});
    const Settings settings = hard(mode);
    const Run end = run(model_of(blocks), settings, 100);
    CHECK(end.crossings == 0);
    CHECK(end.created < 1e-3 * 64 * 9.81 * 2);
    for (std::size_t k = 0; k < 10; ++k) {
      CAPTURE(k);
      // They keep 0.95 of 0.15 of an edge between them, whatever presses on them.
      const glm::dvec3 c = end.motions[k].centre;
      CHECK(c.y == doctest::Approx(0.2 + 0.4225 * double(k)).epsilon(0.004));
      CHECK(std::abs(c.x) < 0.02);
      CHECK(std::abs(c.z) < 0.02);
      CHECK(std::abs(end.motions[k].velocity.y) < 0.02);
    }
  }
}

TEST_CASE_FIXTURE(GlTest, "hard bodies: friction stops one on another where it should (long)") {
  for (const std::string& mode : two_modes) {
    CAPTURE(mode);
    Settings settings = hard(mode);
    settings.friction = 0.3;
    const auto model =
        model_of({{.centre = {0, 0.1, 0}, .size = {4, 0.2, 1}}, {.centre = {-1, 0.424, 0}, .velocity = {2, 0, 0}}});
    const Run end = run(model, settings, 160);
    CHECK(end.crossings == 0);
    CHECK(end.motions[1].centre.x + 1 - end.motions[0].centre.x ==
          doctest::Approx(2 * 2 / (2 * 0.3 * settings.gravity)).epsilon(0.02));
    CHECK(glm::length(end.motions[1].velocity) < 1e-3);
    CHECK(end.created < 0.02);
  }
}

TEST_CASE_FIXTURE(GlTest, "hard bodies: Newton's cradle of three (long)") {
  for (const std::string& mode : two_modes) {
    CAPTURE(mode);
    Settings settings = weightless(hard(mode));
    settings.restitution = 1;
    const auto model =
        model_of({{.centre = {0, 0, 0}}, {.centre = {0.45, 0, 0}}, {.centre = {1, 0, 0}, .velocity = {-2, 0, 0}}});
    const Run end = run(model, settings, 80);
    CHECK(end.motions[0].velocity.x == doctest::Approx(-2).epsilon(0.02));
    CHECK(std::abs(end.motions[1].velocity.x) < 0.04);
    CHECK(std::abs(end.motions[2].velocity.x) < 0.04);
    CHECK(end.created < 0.02 * 128);
  }
}

TEST_CASE_FIXTURE(GlTest, "hard bodies: a stick that falls on its end turns as it should (long)") {
  for (const std::string& mode : two_modes) {
    CAPTURE(mode);
    const Settings settings = weightless(hard(mode));
    const auto model =
        model_of({{.centre = {0, -0.5, 0}, .size = {4, 1, 1}, .fixed = true},
                  {.centre = {0, 0.5, 0}, .velocity = {0, -2, 0}, .rotation = {0, 0, 30}, .size = {1, 0.1, 0.1}}});
    const Body& stick = model->bodies[1];
    // The impulse at its lower edge that leaves that edge no approach.
    const double lever = 0.5 * std::cos(std::numbers::pi / 6) - 0.05 * std::sin(std::numbers::pi / 6);
    double mass = 0, inertia = 0;
    for (std::size_t i = stick.first_vertex; i < stick.first_vertex + stick.vertices; ++i) {
      const glm::dvec3 arm = model->positions[i] - glm::dvec3(0, 0.5, 0);
      mass += model->masses[i], inertia += model->masses[i] * (arm.x * arm.x + arm.y * arm.y);
    }
    const double impulse = 2 / (1 / mass + lever * lever / inertia);
    const Run end = run(model, settings, 34);
    const Motion m = end.motions[1];
    CHECK(end.crossings == 0);
    CHECK(m.velocity.y == doctest::Approx(-2 + impulse / mass).epsilon(0.02));
    const glm::dvec3 spin = m.angular - mass * glm::cross(m.centre, m.velocity);
    CHECK(spin.z == doctest::Approx(-lever * impulse).epsilon(0.02));
    CHECK(end.created < 1e-3 * 20);
  }
}

TEST_CASE_FIXTURE(GlTest, "hard bodies: momentum and energy of a blow off centre (long)") {
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    Settings settings = weightless(hard(mode));
    settings.friction = 0.5;
    const auto model =
        model_of({{.centre = {0, 0, 0}}, {.centre = {0.8, 0.15, 0.1}, .velocity = {-2, 0, 0}, .rotation = {0, 30, 0}}});
    const State start{model->positions, model->velocities};
    const Motion before = motion_of(*model, start, 0, start.positions.size());
    const Run end = run(model, settings, 60);
    const Motion after = motion_of(*model, end.state, 0, start.positions.size());
    CHECK(end.crossings == 0);
    CHECK(glm::length(after.velocity - before.velocity) < 1e-5 * 2);
    CHECK(glm::length(after.angular - before.angular) < 1e-5 * glm::length(before.angular));
    CHECK(end.created < 1e-5 * 128);
    CHECK(energy_of(*model, end.state, settings) < 0.6 * 128);
  }
}

TEST_CASE_FIXTURE(
    GlTest, "hard bodies: a pile comes to rest, and its GPU run goes on from a snapshot to the same bits (long)") {
  std::vector<Block> blocks;
  for (int k = 0; k < 8; ++k)
    blocks.push_back(
        {.centre = {0.6 * (k % 2), 0.3 + 0.5 * (k / 2), 0.1 * ((k * 7) % 5) - 0.2}, .rotation = {0, 17.0 * k, 0}});
  const auto model = model_of(blocks);
  const Settings settings = hard("node");
  Sim sim = create_sim(model, settings);
  const double start = energy_of(*model, read_state(sim), settings);
  double lowest = INFINITY, created = 0;
  Buffer kept;
  std::optional<Snapshot> snapshot;
  for (int s = 0; s < 160; ++s) {
    if (s == 90) kept = Buffer("kept", snapshot_bytes(sim)), snapshot = take_snapshot(sim, kept, 0);
    step(sim);
    const double energy = energy_of(*model, read_state(sim), settings);
    lowest = std::min(lowest, energy), created = std::max(created, energy - lowest);
  }
  const State end = read_state(sim);
  CHECK(find_crossings(*model, end.positions, false).pairs == 0);
  CHECK(created < 0.01 * start);
  restore_snapshot(sim, *snapshot, kept);
  for (int s = 90; s < 160; ++s) step(sim);
  CHECK(read_state(sim).positions == end.positions);
}

TEST_CASE_FIXTURE(GlTest, "hard bodies: on a soft one and under it, momentum is kept (long)") {
  for (const std::string& mode : all_modes) {
    CAPTURE(mode);
    Settings settings = weightless(hard(mode));
    settings.friction = 0.5;
    Material soft;
    soft.stiffness.fill(0.3);
    const auto model = model_of({{.centre = {0, 0, 0}, .velocity = {0, 1, 0}},
                                 {.centre = {0.05, 0.5, 0}},
                                 {.centre = {0, 1, 0.03}, .velocity = {0, -1, 0}, .rotation = {0, 20, 0}}});
    settings.bodies = {{}, {.material = soft}, {}};
    CHECK(any_moves_rigidly(settings));
    const State start{model->positions, model->velocities};
    const Motion before = motion_of(*model, start, 0, start.positions.size());
    const Run end = run(model, settings, 60);
    const Motion after = motion_of(*model, end.state, 0, start.positions.size());
    CHECK(end.crossings == 0);
    CHECK(energy_of(*model, end.state, settings) < 64);
    CHECK(glm::length(after.velocity - before.velocity) < 1e-4);
    CHECK(glm::length(after.angular - before.angular) < 0.01);
    CHECK(end.motions[0].velocity.y < 0.6);  // it has met the soft one
  }
}
