// Held by friction alone: above its threshold, and not below.
#include <doctest/doctest.h>

#include <cmath>

#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

constexpr double E = 1e5, side = 0.1, density = 1000, squeezed = 0.04;  // the part by which it is pressed

// A cube between two walls or pads, whose normal force is E times its face times the part by which it is squeezed.
std::shared_ptr<Model> gripped(bool pads, double gap) {
  auto model = std::make_shared<Model>();
  const auto add = [&](const char* name, const glm::dvec3& size, const glm::ivec3& cells, double x, double held) {
    const TetMesh mesh = make_block(size, cells, true);
    std::vector<glm::dvec3> start = mesh.positions;
    VertexList fixed;
    for (std::uint32_t v = 0; v < start.size(); ++v) {
      if (held != 0 && mesh.positions[v].x * held > size.x / 2 - 1e-9) fixed.push_back(v);
      start[v].x = x + start[v].x * (1 - squeezed);
    }
    add_body(*model, name, mesh, density, start, {}, {}, fixed);
  };
  add("cube", glm::dvec3(side), {2, 2, 2}, 0, 0);
  if (pads) {
    const double apart = side / 2 * (1 - squeezed) + gap + 0.02 * (1 - squeezed);
    add("left", {0.04, 0.14, 0.14}, {1, 3, 3}, -apart, -1), add("right", {0.04, 0.14, 0.14}, {1, 3, 3}, apart, 1);
  } else {
    for (const double direction : {-1.0, 1.0}) {
      Obstacle wall = samples::half_space({-direction, 0, 0});
      wall.centre.x = direction * side / 2 * (1 - squeezed);
      model->obstacles.push_back(wall);
    }
  }
  return model;
}

// m, by which the cube falls in so many seconds.
double fall(const std::string& mode, bool pads, double of_threshold, double seconds) {
  constexpr double gap = 0.002;
  const auto model = gripped(pads, gap);
  const double weight = density * side * side * side * 9.81;
  Settings s;
  s.mode = mode, s.ground = false, s.material = "neo-hookean", s.young_modulus = E, s.poisson_ratio = 0;
  s.contact = pads ? "bodies" : "none", s.contact_distance = gap, s.dt = 0.0025;
  s.friction = of_threshold * weight / (2 * E * side * side * squeezed);
  if (solver_mode(s).implicit) s.substeps = 2, s.iterations = 8;
  Sim sim = create_sim(model, s);
  const auto height = [&] {
    const State state = read_state(sim);
    double sum = 0;
    for (std::size_t v = 0; v < model->bodies[0].vertices; ++v) sum += state.positions[v].y;
    return sum / double(model->bodies[0].vertices);
  };
  const double before = height();
  for (int k = 0; k < int(seconds / s.dt); ++k) step(sim);
  return before - height();
}

}  // namespace

TEST_CASE("a grip holds by friction above its threshold, and lets slide below (long)") {
  GlTest gl;
  for (const bool pads : {false, true})
    for (const char* mode : {"explicit", "newton"}) {
      CAPTURE(pads);
      CAPTURE(mode);
      const double held = fall(mode, pads, 1.1, 0.3), slid = fall(mode, pads, 0.9, 0.3);
      MESSAGE(std::string(mode) << std::string(pads ? " pads " : " walls ") << held << " " << slid);
      // By theory 0 and 0.044 m. Implicit steps learn of the normal force late, and creep where little is to spare.
      CHECK(held < (find_solver_mode(mode)->implicit ? 0.02 : 0.006));
      CHECK(slid > 0.03);
      CHECK(fall(mode, pads, 0, 0.15) > 0.108);  // of 0.110
    }
}
