// Vertices that are led, as by the mouse: they touch what is in their way as anything else does.
#include <doctest/doctest.h>

#include <cmath>
#include <numeric>

#include "sim/measure/crossings.h"
#include "sim/sim.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

// A cube, and a slab `gap` beside it along x that is `thick` and, with `held`, fixed.
struct Scene {
  std::shared_ptr<const Model> model;
  VertexList far_side;  // of the cube
};
Scene scene_of(double thick, bool held, double gap = 0.05) {
  Scene made;
  auto model = std::make_shared<Model>();
  const TetMesh cube = make_block(glm::dvec3(0.2), glm::ivec3(3), true),
                slab = make_block({thick, 0.4, 0.4}, {thick < 0.05 ? 1 : 3, 5, 5}, true);
  const auto placed = [](const TetMesh& mesh, double x) {
    auto start = mesh.positions;
    for (glm::dvec3& p : start) p.x += x;
    return start;
  };
  VertexList all;
  for (std::uint32_t v = 0; v < slab.positions.size() && held; ++v) all.push_back(v);
  add_body(*model, "cube", cube, 1000, placed(cube, 0), glm::dvec3(0), glm::dvec3(0), {});
  add_body(*model, "slab", slab, 1000, placed(slab, 0.1 + gap + thick / 2), glm::dvec3(0), glm::dvec3(0), all);
  for (std::uint32_t v = 0; v < model->bodies[0].vertices; ++v)
    if (model->positions[v].x < -0.1 + 1e-9) made.far_side.push_back(v);
  made.model = model;
  return made;
}

Settings settings_of(const std::string& mode) {
  Settings s;
  s.mode = mode, s.contact = "bodies", s.material = "neo-hookean", s.young_modulus = 1e5, s.poisson_ratio = 0.3;
  s.gravity = 0, s.ground = false, s.friction = 0, s.dt = 0.005;
  s.substeps = solver_mode(s).leapfrog ? automatic : mode == "newton" ? 1 : 10;
  s.iterations = solver_mode(s).implicit ? 8 : 2;
  return s;
}

// Leads one side of the cube along x at `speed`, and gives the most crossing pairs of all steps.
std::size_t crossings_led(Sim& sim, const VertexList& led, double speed, int steps) {
  std::size_t most = 0;
  std::vector<glm::dvec3> places;
  for (const std::uint32_t v : led) places.push_back(sim.model->positions[v]);
  pin(sim, led);
  for (int s = 0; s < steps; ++s) {
    for (glm::dvec3& place : places) place.x += speed * sim.settings.dt;
    move_pinned(sim, led, places);
    step(sim);
    most = std::max(most, find_crossings(*sim.model, read_state(sim).positions, false).pairs);
  }
  REQUIRE_FALSE(check_finite(sim, true));
  return most;
}

constexpr std::array modes{"explicit", "node", "newton", "cpu-double", "cpu-fast"};

}  // namespace

TEST_CASE("led: a body that is led bats another away, which goes on as fast or faster (long)") {
  GlTest gl;
  for (const char* mode : modes) {
    CAPTURE(std::string(mode));
    const Scene scene = scene_of(0.2, false);
    Sim sim = create_sim(scene.model, settings_of(mode));
    CHECK(crossings_led(sim, scene.far_side, 2, 30) == 0);  // 30 cm, of which 5 to the slab
    const State state = read_state(sim);
    const Body& slab = scene.model->bodies[1];
    double speed = 0;
    for (std::size_t v = slab.first_vertex; v < slab.first_vertex + slab.vertices; ++v)
      speed += state.velocities[v].x / double(slab.vertices);
    CHECK(speed > 1.4);
    CHECK(speed < 4);
    for (const std::uint32_t v : scene.far_side) {
      CHECK(state.positions[v].x == doctest::Approx(scene.model->positions[v].x + 0.3).epsilon(1e-4));
      CHECK(state.velocities[v] == glm::dvec3(0));
    }
  }
}

TEST_CASE("led: pulled against what is fixed, nothing passes through, not even the vertices that are led (long)") {
  GlTest gl;
  for (const char* mode : modes)
    for (const double speed : {1.0, 8.0}) {
      CAPTURE(std::string(mode));
      CAPTURE(speed);
      const Scene scene = scene_of(0.02, true);
      Sim sim = create_sim(scene.model, settings_of(mode));
      const VertexList& near = scene.far_side;
      CHECK(crossings_led(sim, near, speed, int(0.3 / (speed * sim.settings.dt))) == 0);
      // What is pressed out beside the slab may be behind its plane.
      const State state = read_state(sim);
      for (const std::uint32_t v : near)
        if (const glm::dvec3& p = state.positions[v]; std::max(std::abs(p.y), std::abs(p.z)) < 0.2)
          CHECK(p.x < 0.17 + 1e-6);
    }
}

TEST_CASE("led: what is led from afar is seen in time, also where nothing else moves (long)") {
  GlTest gl;
  for (const char* mode : {"explicit", "node", "newton"}) {
    CAPTURE(std::string(mode));
    const Scene scene = scene_of(0.02, true, 1);
    Sim sim = create_sim(scene.model, settings_of(mode));
    VertexList all(scene.model->bodies[0].vertices);
    std::iota(all.begin(), all.end(), 0u);
    CHECK(crossings_led(sim, all, 20, 12) == 0);  // 1.2 m
  }
}

TEST_CASE("led: a vertex goes evenly over the substeps of a step, and is still after it (long)") {
  GlTest gl;
  for (const char* mode : modes) {
    CAPTURE(std::string(mode));
    const Scene scene = scene_of(0.2, false);
    Settings settings = settings_of(mode);
    settings.contact = "none";
    Sim sim = create_sim(scene.model, settings);
    const std::uint32_t v = scene.far_side[0];
    const glm::dvec3 to = scene.model->positions[v] + glm::dvec3(-0.01, 0.02, 0.003);
    pin(sim, v), move_pinned(sim, v, glm::dvec3(9));
    move_pinned(sim, v, to);  // the last word counts
    step(sim);
    CHECK(glm::distance(read_state(sim).positions[v], to) < 1e-7);
    step(sim);
    CHECK(glm::distance(read_state(sim).positions[v], to) < 1e-7);
    move_pinned(sim, v, scene.model->positions[v]);
    unpin(sim, v);  // it is free, and nobody leads it
    step(sim);
    CHECK(glm::distance(read_state(sim).positions[v], to) < 0.02);
    CHECK(glm::distance(read_state(sim).positions[v], scene.model->positions[v]) > 1e-3);
    move_pinned(sim, v, scene.model->positions[v]);
    reset(sim);
    pin(sim, v), step(sim);
    CHECK(glm::distance(read_state(sim).positions[v], scene.model->positions[v]) < 1e-7);
  }
}
