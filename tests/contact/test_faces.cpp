// Faces of bodies against obstacles that get in between their vertices: cloth over edges, blocks of few tets on posts.
#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "sim/contact/faces.h"
#include "sim/contact/obstacle_kinds.h"
#include "sim/measure/ledger.h"
#include "sim/measure/metrics.h"
#include "sim/sim.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

Obstacle box(const glm::dvec3& centre, const glm::dvec3& half) {
  Obstacle o;
  o.kind = find_obstacle_kind("box"), o.centre = centre, o.half = half;
  return o;
}

// A cloth of 1 m over a box of 40 cm, whose edges lie between its vertices.
std::shared_ptr<Model> cloth_on_box() {
  auto model = std::make_shared<Model>();
  model->obstacles = {box({0, 0.4, 0}, glm::dvec3(0.2))};
  TetMesh sheet = make_sheet({1, 1}, {16, 16});
  sheet.thickness = 0.001;
  auto start = sheet.positions;
  for (glm::dvec3& p : start) p = rotation_of({0, 11, 0}) * p + glm::dvec3(0.013, 0.62, 0.021);
  add_body(*model, "cloth", sheet, 400, start, glm::dvec3(0), glm::dvec3(0), {});
  return model;
}
Settings of_cloth(const std::string& mode) {
  Settings s;
  s.mode = mode, s.constraints = "stretch,isobend", s.damping = 0.5;
  s.compliance[std::size_t(index_of<Stretch>)] = 1e-6, s.compliance[std::size_t(index_of<Isobend>)] = 1e3;
  s.constraint_damping = 1e-3, s.iterations = solver_mode(s).implicit ? 16 : 1, s.dt = 0.005, s.friction = 0.3;
  s.substeps = solver_mode(s).leapfrog ? automatic : solver_mode(s).implicit ? 2 : 20;
  return s;
}

// A block of a single cell over a post that is thinner than it.
std::shared_ptr<Model> block_on_post(const glm::dvec3& velocity = glm::dvec3(0)) {
  auto model = std::make_shared<Model>();
  model->obstacles = {box({0, 0.25, 0}, {0.1, 0.25, 0.1})};
  const TetMesh block = make_block(glm::dvec3(0.8), glm::ivec3(1), true);
  auto start = block.positions;
  for (glm::dvec3& p : start) p += glm::dvec3(0.02, 0.92, 0.01);
  add_body(*model, "block", block, 1000, start, velocity, glm::dvec3(0), {});
  return model;
}
Settings of_block(const std::string& mode) {
  Settings s;
  s.mode = mode, s.material = "neo-hookean", s.young_modulus = 1e6, s.poisson_ratio = 0.3, s.dt = 0.005;
  s.friction = 0.5, s.constraint_damping = 2e-3;
  s.substeps = solver_mode(s).leapfrog ? automatic : solver_mode(s).implicit ? 2 : 20;
  s.iterations = solver_mode(s).implicit ? 8 : 4;
  return s;
}

EnergyLedger ledger_after(Sim& sim, int steps) {
  Metrics metrics = create_metrics(sim);
  EnergyLedger ledger;
  for (int s = 0; s < steps; ++s) {
    measure(metrics, sim);
    while (const auto now = collect(metrics, true)) add_measurement(ledger, *now, *sim.model, sim.settings);
    step(sim);
  }
  return ledger;
}

double depth_of(const Sim& sim) {
  return deepest_face(wide_faces(*sim.model), obstacles_at(*sim.model, sim.settings, simulated_time(sim)),
                      read_state(sim).positions);
}

}  // namespace

TEST_CASE("faces: the deepest point of a triangle is that of a fine lattice") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto point = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  for (int round = 0; round < 200; ++round) {
    const Obstacle o = box({}, {0.3, 0.5, 0.2});
    const glm::dvec3 a = point(), b = point(), c = point();
    Formulas<double> f{nullptr, o.kind->distance};
    const auto solid = describe_solid(o);
    const auto found = f.deepest_point(solid, a, b, c);
    double least = 1e9;
    constexpr int parts = 60;
    for (int i = 0; i <= parts; ++i)
      for (int j = 0; j <= parts - i; ++j)
        least = std::min(
            least,
            f.surface_of(solid, (double(i) * a + double(j) * b + double(parts - i - j) * c) / double(parts)).distance);
    CAPTURE(round);
    CHECK(found.surface.distance < least + 0.1);
    CHECK(found.weights.x + found.weights.y + found.weights.z == doctest::Approx(1));
    CHECK(f.surface_of(solid, found.weights.x * a + found.weights.y * b + found.weights.z * c).distance ==
          doctest::Approx(found.surface.distance));
  }
}

TEST_CASE("faces: those that are looked at are of sheets beside edges, and as wide as an obstacle") {
  CHECK(wide_faces(*cloth_on_box()).size() == 512);
  CHECK(wide_faces(*block_on_post()).size() == 12);
  const auto with = [](const std::shared_ptr<Model>& model, const Obstacle& o) {
    model->obstacles = {o};
    return wide_faces(*model).size();
  };
  Obstacle ball, plane;
  ball.kind = find_obstacle_kind("sphere"), ball.radius = 0.5, plane.normal = {0, 1, 0};
  CHECK(with(cloth_on_box(), ball) == 0);
  CHECK(with(cloth_on_box(), plane) == 0);
  CHECK(with(block_on_post(), box({}, glm::dvec3(3))) == 0);
}

TEST_CASE_FIXTURE(GlTest, "faces: a cloth lies over the edges of a box, not in it (long)") {
  for (const char* mode : {"node", "newton", "cpu-double", "cpu-fast"}) {
    CAPTURE(std::string(mode));
    Sim sim = create_sim(cloth_on_box(), of_cloth(mode));
    double deepest = 0;
    for (int s = 0; s < 120; ++s) {
      step(sim);
      if (s % 20 == 19) deepest = std::max(deepest, depth_of(sim));
    }
    REQUIRE_FALSE(check_finite(sim, true));
    MESSAGE(std::string(mode), ": ", 1000 * deepest, " mm");
    CHECK(deepest < 0.004);  // of cells of 62 mm; without, 26 mm
    const State state = read_state(sim);
    double lowest = 1, highest = 0;
    for (const glm::dvec3& p : state.positions) lowest = std::min(lowest, p.y), highest = std::max(highest, p.y);
    CHECK(highest > 0.6 - 1e-4);
    CHECK(highest < 0.65);
    CHECK(lowest < 0.5);  // it hangs down
  }
}

TEST_CASE_FIXTURE(GlTest, "faces: a block of one cell stands on a post that meets none of its vertices (long)") {
  for (const char* mode : {"explicit", "node", "newton", "cpu-double", "cpu-fast"}) {
    CAPTURE(std::string(mode));
    const auto model = block_on_post();
    Sim sim = create_sim(model, of_block(mode));
    const EnergyLedger ledger = ledger_after(sim, 200);
    REQUIRE_FALSE(check_finite(sim, true));
    double centre = 0;
    const State state = read_state(sim);
    for (const glm::dvec3& p : state.positions) centre += p.y / double(state.positions.size());
    CHECK(centre > 0.85);
    CHECK(centre < 0.925);
    CHECK(depth_of(sim) < 0.004);
    MESSAGE(std::string(mode), ": depth ", depth_of(sim), " m, created ", ledger.relative());
    CHECK(ledger.relative() < 0.01);
  }
}

TEST_CASE_FIXTURE(GlTest, "faces: a post that rises lifts a block, and that is its work") {
  for (const char* mode : {"explicit", "node", "cpu-double"}) {
    CAPTURE(std::string(mode));
    const auto model = block_on_post();
    model->obstacles[0].velocity = {0, 0.2, 0};
    Sim sim = create_sim(model, of_block(mode));
    const EnergyLedger ledger = ledger_after(sim, 200);
    const double lifted = 512 * 9.81 * 0.2;  // J, in a second
    CHECK(ledger.work == doctest::Approx(lifted).epsilon(0.1));
    CHECK(ledger.relative() < 0.02);
  }
}
