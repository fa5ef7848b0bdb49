// Mode newton on obstacles: what is at rest stays, what friction can hold stops, and what slides does so as it should.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "sim/contact/obstacle_kinds.h"
#include "sim/measure/ledger.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"

using namespace tetpbd;

namespace {

struct Block {
  double modulus, density = 1000, size = 0.3, slope = 0;  // slope in degrees, about z
  glm::dvec3 velocity{0};
  double height = 0;                 // m, over the plane
  std::optional<double> friction{};  // of the body
};

std::shared_ptr<Model> on_plane(const Block& block) {
  TetMesh mesh = make_block(glm::dvec3(block.size, 0.5 * block.size, block.size), {4, 2, 4}, true);
  const double low = bounds(mesh.positions).low.y;
  const glm::dvec3 centre = bounds(mesh.positions).centre();
  for (glm::dvec3& p : mesh.positions)
    p = rotation_of({0, 0, block.slope}) * (p - glm::dvec3(centre.x, low - block.height, centre.z));
  auto model = std::make_shared<Model>();
  Obstacle& plane = model->obstacles.emplace_back();
  plane.kind = find_obstacle_kind("half-space");
  plane.normal = rotation_of({0, 0, block.slope}) * glm::dvec3(0, 1, 0);
  add_body(*model, "block", mesh, block.density, mesh.positions, block.velocity, glm::dvec3(0), {});
  return model;
}

Settings newton(double modulus, double dt = 0.005) {
  Settings s;
  s.mode = "newton", s.material = "neo-hookean", s.young_modulus = modulus, s.poisson_ratio = 0.3;
  s.ground = false, s.dt = dt, s.substeps = 1, s.iterations = 4, s.friction = 0.5;
  return s;
}

struct Outcome {
  glm::dvec3 moved;  // m, of the centre of mass
  double kinetic;    // J
  double speed;      // m/s, of the centre
};
Outcome after(const Block& block, const Settings& settings, double seconds) {
  const auto model = on_plane(block);
  Settings own = settings;
  own.bodies = {{.friction = block.friction}};
  Sim sim = create_sim(model, own);
  Metrics metrics = create_metrics(*model, sim.system);
  const Measurement first = measure_now(metrics, sim);
  for (int s = 0; s < int(seconds / settings.dt); ++s) step(sim);
  REQUIRE_FALSE(check_finite(sim, true));
  const Measurement last = measure_now(metrics, sim);
  double mass = 0;
  for (const double m : model->masses) mass += m;
  return {last.centre - first.centre, last.kinetic, glm::length(last.momentum) / mass};
}

}  // namespace

TEST_CASE_FIXTURE(GlTest,
                  "newton: a block at rest stays at rest, whatever its stiffness, its density and the step (long)") {
  for (const double modulus : {1e7, 1e9, 1e12})
    for (const double density : {1.0, 1e3})
      for (const double dt : {0.002, 0.02}) {
        if (!is_long_run() && density < 1e3 && modulus != 1e9) continue;
        CAPTURE(modulus);
        CAPTURE(density);
        CAPTURE(dt);
        const Block block{.modulus = modulus, .density = density};
        const Outcome rest = after(block, newton(modulus, dt), 100 * dt);
        const double mass = density * 0.5 * std::pow(block.size, 3);
        CHECK(std::hypot(rest.moved.x, rest.moved.z) < 1e-4 * block.size);
        CHECK(std::abs(rest.moved.y) < 3e-4 * block.size);
        CHECK(rest.kinetic < 1e-9 * mass * 9.81 * block.size);
      }
}

TEST_CASE_FIXTURE(GlTest, "newton: a soft block sags on the ground and stays where it is") {
  const Outcome rest = after({.modulus = 1e5}, newton(1e5), 1);
  CHECK(std::hypot(rest.moved.x, rest.moved.z) < 1e-3 * 0.3);
  CHECK(rest.moved.y < 0);
}

TEST_CASE_FIXTURE(
    GlTest, "newton: below the angle of friction a block stops, at any size, and above it slides as it should (long)") {
  for (const double modulus : {1e6, 1e9})
    for (const double size : {0.4, 0.001}) {
      if (size < 0.01 && modulus > 1e6) continue;  // stiffer than floats tell, and the same therefore
      CAPTURE(modulus);
      CAPTURE(size);
      for (const double angle : {10.0, 20.0, 26.0}) {
        CAPTURE(angle);
        const Block block{.modulus = modulus, .size = size, .slope = angle};
        const Outcome held = after(block, newton(modulus), 1);
        // A step falls freely before it holds, and just below the angle of friction that takes long to stop.
        CHECK(glm::length(held.moved) < (angle > 25 ? 5e-3 : size > 0.01 ? 2e-3 * size : 5e-4));
        CHECK(held.speed < 1e-4);
      }
    }
  for (const double modulus : {1e7, 1e9}) {
    CAPTURE(modulus);
    const double angle = 35 * std::numbers::pi / 180, right = 9.81 * (std::sin(angle) - 0.5 * std::cos(angle));
    const Block block{.modulus = modulus, .size = 0.4, .slope = 35};
    const double faster = after(block, newton(modulus), 1).speed - after(block, newton(modulus), 0.5).speed;
    CHECK(faster / 0.5 == doctest::Approx(right).epsilon(0.02));
  }
}

TEST_CASE_FIXTURE(GlTest, "newton: what slides on level ground stops where Coulomb's law says") {
  for (const double modulus : {1e7, 1e10}) {
    CAPTURE(modulus);
    const Outcome slid = after({.modulus = modulus, .velocity = {1, 0, 0}}, newton(modulus), 0.6);
    CHECK(slid.moved.x == doctest::Approx(1 / (2 * 0.5 * 9.81)).epsilon(0.05));
    CHECK(slid.speed < 1e-4);
  }
  const Outcome rough = after({.modulus = 1e7, .velocity = {1, 0, 0}, .friction = 0.9}, newton(1e7), 0.4);
  CHECK(rough.moved.x == doctest::Approx(1 / (2 * 0.9 * 9.81)).epsilon(0.08));
}

TEST_CASE_FIXTURE(GlTest, "newton: a stiff block that lands comes to rest where it landed") {
  for (const double modulus : {1e9, 2e11}) {
    CAPTURE(modulus);
    const Outcome fallen = after({.modulus = modulus, .density = 7800, .height = 1}, newton(modulus, 0.01), 1.5);
    CHECK(std::hypot(fallen.moved.x, fallen.moved.z) < 0.3);
    CHECK(fallen.moved.y == doctest::Approx(-1).epsilon(0.01));
    CHECK(fallen.speed < 1e-3);
  }
}

TEST_CASE_FIXTURE(GlTest, "newton: blocks of any stiffness that fall on a corner, spinning, create no energy (long)") {
  struct Fall {
    double modulus, density, dt, height;
    glm::dvec3 turn, spin;
    int iterations;
  };
  for (const Fall& f : {Fall{1e6, 1000, 0.005, 1, {12, 0, 7}, {20, 5, 0}, 4},       // soft for its step, spinning fast
                        Fall{3e6, 300, 0.0025, 1.5, {20, 10, -30}, {2, -6, 5}, 8},  // springs back within a few steps
                        Fall{1.2e8, 3000, 0.0025, 0.3, {-32, -37, 37}, {3, -4, 5}, 8},  // one light vertex bears it
                        Fall{1e11, 7800, 0.01, 1, {30, 0, 20}, {1, 2, 3}, 4}}) {
    CAPTURE(f.modulus);
    TetMesh mesh = make_block({0.3, 0.3, 0.3}, {4, 2, 4}, true);
    for (glm::dvec3& p : mesh.positions) p = rotation_of(f.turn) * p + glm::dvec3(0, f.height, 0);
    auto model = std::make_shared<Model>();
    add_body(*model, "block", mesh, f.density, mesh.positions, {}, f.spin, {});
    Settings settings = newton(f.modulus, f.dt);
    settings.ground = true, settings.iterations = f.iterations;
    Sim sim = create_sim(model, settings);
    Metrics metrics = create_metrics(*model, sim.system);
    EnergyLedger ledger;
    add_measurement(ledger, measure_now(metrics, sim), *model, settings);
    for (int s = 0; s < int(1 / f.dt); ++s) {
      step(sim);
      add_measurement(ledger, measure_now(metrics, sim), *model, settings);
    }
    CHECK(ledger.relative() < 0.01);
  }
}
