// Bodies that are attached to each other: in every mode, against one mesh and closed forms.
#include <doctest/doctest.h>

#include <cmath>

#include "sim/measure/metrics.h"
#include "sim/model/attachments.h"
#include "sim/sim.h"
#include "sim/snapshot.h"
#include "sim/state_file.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

const glm::dvec3 half{0.2, 0.1, 0.1};

// A block from x = `left` on, whose lower end is fixed where it is asked for.
void add_half(Model& model, double left, bool fixed, const glm::dvec3& size = half, const glm::ivec3& cells = {4, 2, 2},
              const glm::dvec3& velocity = glm::dvec3(0)) {
  TetMesh mesh = make_block(size, cells, true);
  VertexList held;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    mesh.positions[v].x += left + size.x / 2;
    if (fixed && mesh.positions[v].x < left + 1e-9) held.push_back(v);
  }
  finish_tets(mesh, "half");
  add_body(model, fixed ? "held" : "free", mesh, 1000, mesh.positions, velocity, {}, held);
}

// Attaches body 1 to body 0, all of it that is near.
Attachment& attach_second(Model& model, double within, double stiffness = 0) {
  Attachment a{1, 0, {}, {}, {}, stiffness, {}};
  std::vector<char> chosen(model.positions.size());
  for (std::size_t t = model.bodies[1].first_triangle; t < model.rest.surface.size(); ++t)
    for (const std::uint32_t v : model.rest.surface[t])
      if (!std::exchange(chosen[v], 1)) a.vertices.push_back(v);
  attach(model, a, within, false);
  model.attachments.push_back(a);
  return model.attachments.back();
}

std::shared_ptr<Model> halves(bool fixed, double gap = 0) {
  auto model = std::make_shared<Model>();
  add_half(*model, 0, fixed), add_half(*model, half.x + gap, false);
  attach_second(*model, gap + 1e-6);
  return model;
}

Settings settings_of(const std::string& mode) {
  Settings s;
  s.mode = mode, s.ground = false, s.material = "neo-hookean", s.young_modulus = 2e5;
  if (!solver_mode(s).forces) s.substeps = 40;
  if (solver_mode(s).implicit) s.iterations = 12;
  return s;
}

// The lowest point.
double sag(const State& state) {
  double lowest = 1e9;
  for (const glm::dvec3& x : state.positions) lowest = std::min(lowest, x.y);
  return lowest;
}

glm::dvec3 momentum(const Sim& sim, const State& state) {
  glm::dvec3 sum(0);
  for (std::size_t v = 0; v < sim.masses.size(); ++v) sum += sim.masses[v] * state.velocities[v];
  return sum;
}
glm::dvec3 angular_momentum(const Sim& sim, const State& state) {
  glm::dvec3 sum(0);
  for (std::size_t v = 0; v < sim.masses.size(); ++v)
    sum += sim.masses[v] * glm::cross(state.positions[v], state.velocities[v]);
  return sum;
}

}  // namespace

TEST_CASE("attached halves with vertices in the same places are one mesh") {
  GlTest gl;
  auto whole = std::make_shared<Model>();
  add_half(*whole, 0, true, {2 * half.x, half.y, half.z}, {8, 2, 2});
  Settings s = settings_of("cpu-double");
  s.substeps = 20, s.iterations = 100;
  Sim one = create_sim(whole, s), two = create_sim(halves(true), s);
  for (int k = 0; k < 30; ++k) step(one), step(two);
  CHECK(std::abs((sag(two.host)) / (sag(one.host)) - 1) < 1e-4);
  CHECK(sag(one.host) < -0.052);  // it has moved
}

TEST_CASE("attached halves sag alike in every mode, and keep the gap that they had (long)") {
  GlTest gl;
  for (const double gap : {0.0, 0.01}) {
    CAPTURE(gap);
    Settings s = settings_of("cpu-double");
    s.substeps = 100;
    Sim right = create_sim(halves(true, gap), s);
    for (int k = 0; k < 30; ++k) step(right);
    for (const char* mode : {"node", "constraint", "gauss-seidel", "cpu-fast", "explicit", "newton", "vbd"}) {
      CAPTURE(mode);
      Sim sim = create_sim(halves(true, gap), settings_of(mode));
      for (int k = 0; k < 30; ++k) step(sim);
      const State state = read_state(sim);
      const double moved = -0.05 - sag(right.host);
      CHECK(std::abs(sag(state) - sag(right.host)) < 0.06 * moved);
      const Attachment& a = sim.model->attachments[0];
      for (std::size_t k = 0; k < a.vertices.size(); ++k) {
        const Triangle& t = a.triangles[k];
        double nearest = 1;
        for (const std::uint32_t v : t)
          nearest = std::min(nearest, glm::distance(state.positions[v], state.positions[a.vertices[k]]));
        CHECK(std::abs(nearest - gap) < 3e-3);
      }
    }
  }
}

TEST_CASE("attached bodies that fly and spin keep momentum and energy in every mode (long)") {
  GlTest gl;
  for (const char* mode : {"node", "constraint", "cpu-double", "cpu-fast", "explicit", "newton", "vbd"}) {
    CAPTURE(mode);
    auto model = halves(false, 0.01);
    for (std::size_t v = 0; v < model->positions.size(); ++v)
      model->velocities[v] = glm::cross(glm::dvec3(0, 3, 8), model->positions[v]) + glm::dvec3(1, 0, 0);
    Settings s = settings_of(mode);
    s.gravity = 0;
    if (mode == std::string("vbd")) s.substeps = 20;  // implicit Euler slows what spins
    Sim sim = create_sim(model, s);
    const State before = read_state(sim);
    Metrics metrics = create_metrics(sim);
    RunErrors errors;
    for (int k = 0; k < 60; ++k) {
      measure(metrics, sim);
      step(sim);
    }
    while (const auto m = collect(metrics, true)) add_measurement(errors, *m, sim);
    const State after = read_state(sim);
    CHECK(glm::length(momentum(sim, after) - momentum(sim, before)) < 1e-3 * glm::length(momentum(sim, before)));
    CHECK(glm::length(angular_momentum(sim, after) - angular_momentum(sim, before)) <
          5e-3 * glm::length(angular_momentum(sim, before)));
    CHECK(errors.ledger.relative() < 0.01);
  }
}

TEST_CASE("an attachment of some stiffness stretches by the weight over it") {
  GlTest gl;
  for (const char* mode : {"node", "cpu-double", "explicit", "newton"}) {
    CAPTURE(mode);
    auto model = std::make_shared<Model>();
    const glm::dvec3 cube(0.1);
    add_half(*model, 0, true, cube, {2, 2, 2}), add_half(*model, 0.1, false, cube, {2, 2, 2});
    constexpr double stiffness = 400;
    attach_second(*model, 1e-6, stiffness);
    for (glm::dvec3* list : {model->positions.data(), model->rest.positions.data()})  // x downwards
      for (std::size_t v = 0; v < model->positions.size(); ++v) list[v] = {list[v].y, -list[v].x, list[v].z};
    Settings s = settings_of(mode);
    s.young_modulus = 1e6, s.damping = 4;
    Sim sim = create_sim(model, s);
    const double start = sag(read_state(sim)), weight = 1 * s.gravity;
    for (int k = 0; k < 800; ++k) step(sim);
    CHECK(std::abs((start - sag(read_state(sim))) / (weight / stiffness) - 1) < 0.02);
  }
}

TEST_CASE("an attachment lets go where more pulls than it bears, and holds again after going back (long)") {
  GlTest gl;
  for (const char* mode : {"node", "cpu-double", "explicit", "newton"})
    for (const double part : {0.7, 3.0}) {
      CAPTURE(mode);
      CAPTURE(part);
      auto model = std::make_shared<Model>();
      add_half(*model, 0, true), add_half(*model, half.x, false);
      Attachment& a = attach_second(*model, 1e-6);
      Settings s = settings_of(mode);
      s.damping = 2;
      a.break_force = part * 2 * s.gravity;  // of a block of 2 kg; the sudden load is up to twice that
      Sim sim = create_sim(model, s);
      step(sim);
      const Buffer room("snapshot", std::max<std::size_t>(snapshot_bytes(sim), 4));
      const Snapshot early = take_snapshot(sim, room, 0);
      for (int k = 0; k < 100; ++k) step(sim);
      CHECK((sag(read_state(sim)) < -0.5) == (part < 1));
      CHECK(sim.broken.empty() == (part > 1));
      restore_snapshot(sim, early, room);
      CHECK(sim.broken.empty());
      CHECK(sim.system.lists[index_of<Attach>].count() == 3 * model->attachments[0].vertices.size());
      step(sim);
      reset(sim);
      CHECK(sim.broken.empty());
    }
}

TEST_CASE("a state says which attachments have let go, and goes on by the same bits") {
  GlTest gl;
  const run_program::Folder folder;
  for (const char* mode : {"node", "cpu-fast", "explicit", "newton"}) {
    CAPTURE(mode);
    auto model = halves(true);
    model->attachments[0].break_force = 1e-3;
    Sim sim = create_sim(model, settings_of(mode));
    for (int k = 0; k < 5; ++k) step(sim);
    REQUIRE(!sim.broken.empty());
    save_state(sim, folder.path / "a.state");
    Sim other = create_sim(model, settings_of(mode));
    CHECK(load_state(other, folder.path / "a.state"));
    CHECK(other.broken == sim.broken);
    for (int k = 0; k < 5; ++k) step(sim), step(other);
    CHECK(state_hash(sim) == state_hash(other));
  }
}

TEST_CASE("a hard body moves as a rigid one unless it is attached, and again once it has let go") {
  GlTest gl;
  auto model = std::make_shared<Model>();
  add_half(*model, 0, true), add_half(*model, half.x, false), add_half(*model, 3, false);
  attach_second(*model, 1e-6).break_force = 1e-3;
  Settings s = settings_of("node");
  s.bodies.resize(3);
  for (std::size_t b : {1, 2}) s.bodies[b].material = Material{};
  Sim sim = create_sim(model, s);
  CHECK(loose_pieces(*model, sim.system) == std::vector<char>{0, 0, 1});
  for (int k = 0; k < 3 && sim.broken.empty(); ++k) step(sim);
  REQUIRE(!sim.broken.empty());
  CHECK(loose_pieces(*model, sim.system) == std::vector<char>{1, 1, 1});
}
