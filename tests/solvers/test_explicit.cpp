// Mode explicit: its substeps are those of leapfrog in double, as many as stay stable.
#include <doctest/doctest.h>

#include <cmath>

#include "sim/error.h"
#include "sim/measure/metrics.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/reference/reference_scenes.h"

using namespace tetpbd;
using reference_scenes::centre_of, reference_scenes::irregular_block, reference_scenes::largest_distance;

namespace {

Settings soft(const std::string& material, double tau) {
  Settings settings;
  settings.mode = "explicit", settings.material = material, settings.constraint_damping = tau;
  settings.young_modulus = 5e6, settings.damping = 0.3, settings.stability = 0.25;
  if (material == "smoothed") settings.material = "neo-hookean", settings.element = "smoothed";
  if (material == "none") {
    settings.compliance[index_of<Stretch>] = 2e-6, settings.compliance[index_of<Volume>] = 1e-10;
    settings.compliance[index_of<Bend>] = 1e-2;
  }
  return settings;
}

}  // namespace

TEST_CASE("explicit: a run is that of leapfrog in double, damped or not, in flight, held and in contact") {
  GlTest gl;
  for (const char* material : {"none", "springs", "neo-hookean", "smoothed"})
    for (const double tau : {0.0, 1e-3})
      for (const int kind : {0, 1, 2}) {
        CAPTURE(material);
        CAPTURE(tau);
        CAPTURE(kind);
        const auto model = irregular_block(kind == 2 ? 0.01 : 1, kind == 1);
        Sim sim = create_sim(model, soft(material, tau));
        const double h = sim.settings.dt / sim.plan.substeps;
        const ReferenceInput input{*model, sim.system, sim.settings, sim.inverse_masses};
        Leapfrog right = leapfrog(input, reference_compliances(input), {model->positions, model->velocities}, h);
        for (int s = 0; s < 20; ++s) step(sim), advance(right, sim.plan.substeps);
        const State state = read_state(sim);
        CHECK(largest_distance(state.positions, right.x) < 2e-5);
        CHECK(largest_distance(state.velocities, right.v) < 2e-2);
        double deformed = 0;  // or nothing was tested
        for (std::size_t i = 0; i < 20; ++i)
          deformed = std::max(deformed, std::abs(glm::distance(right.x[i], right.x[i + 7]) /
                                                     glm::distance(model->positions[i], model->positions[i + 7]) -
                                                 1));
        if (kind > 0) CHECK(deformed > 1e-3);
      }
}

TEST_CASE("explicit: substeps follow stiffness, dt and the part of the stable one that is asked for") {
  GlTest gl;
  Settings settings = soft("neo-hookean", 0);
  Sim sim = create_sim(irregular_block(1, false), settings);
  const auto substeps = [&](auto&& change) {
    Settings wanted = settings;
    change(wanted);
    apply_settings(sim, wanted);
    CHECK(sim.plan.iterations == 1);
    return sim.plan.substeps;
  };
  const double longest = stable_step({*sim.model, sim.system, settings, sim.inverse_masses}, settings.compliance,
                                     sim.model->rest.positions);
  const double all = settings.dt / (settings.stability * longest);
  REQUIRE(all > 3);
  CHECK(std::abs(substeps([](Settings&) {}) - all) < 1.05);
  CHECK(std::abs(substeps([](Settings& s) { s.young_modulus *= 16; }) - 4 * all) < 1.2);
  CHECK(std::abs(substeps([](Settings& s) { s.dt *= 3; }) - 3 * all) < 1.2);
  CHECK(std::abs(substeps([](Settings& s) { s.stability /= 2; }) - 2 * all) < 1.2);
  CHECK(substeps([](Settings& s) { s.substeps = 77, s.iterations = 9; }) == 77);  // more than it needs
  CHECK(substeps([](Settings& s) { s.substeps = 2; }) == substeps([](Settings&) {}));
  CHECK_THROWS_WITH_AS(substeps([](Settings& s) { s.young_modulus = 1e12, s.dt = 1, s.stability = 0.01; }),
                       doctest::Contains("too stiff for mode explicit"), Error);
  Settings bare = settings;
  bare.material = "none", bare.constraints = "";
  apply_settings(sim, bare);
  CHECK(sim.plan.substeps == 1);
}

namespace {

// The block in flight, `by` times as large along its axes at the start.
std::shared_ptr<const Model> deformed_block(const glm::dvec3& by) {
  auto model = std::make_shared<Model>(*irregular_block(5, false));
  const glm::dvec3 centre = centre_of(*model, model->positions);
  for (glm::dvec3& p : model->positions) p = centre + by * (p - centre);
  return model;
}

}  // namespace

TEST_CASE("explicit: kernels note the stiffest constraint, it moves with the largest eigenvalue") {
  GlTest gl;
  for (const char* material : {"none", "springs", "neo-hookean", "smoothed"})
    for (const glm::dvec3 by : {glm::dvec3(1), glm::dvec3(2, 1, 1), glm::dvec3(0.3, 1.2, 1.2), glm::dvec3(-1, 1, 1),
                                glm::dvec3(1, 3, 3), glm::dvec3(2.5)}) {
      CAPTURE(material);
      CAPTURE(by.x);
      CAPTURE(by.y);
      const auto model = deformed_block(by);
      Sim sim = create_sim(model, soft(material, 0));
      const ReferenceInput input{*model, sim.system, sim.settings, sim.inverse_masses};
      const auto& alpha = sim.settings.compliance;
      const double stiffest = stiffest_constraint(input, alpha, model->positions);
      const double ratio = stiffest / stiffest_constraint(input, alpha, model->rest.positions);
      const double eigenvalues =
          std::pow(stable_step(input, alpha, model->rest.positions) / stable_step(input, alpha, model->positions), 2);
      CHECK(stiffest > 0.98 / std::pow(stable_step(input, alpha, model->positions) / 2, 2));
      CHECK(ratio > 0.4 * eigenvalues);
      CHECK(ratio < 2.5 * eigenvalues);
      const double h = sim.settings.dt / sim.plan.substeps;
      step(sim);
      const float noted = sim.check.words.read_all<float>()[2];
      CHECK(noted / (h * h) == doctest::Approx(stiffest).epsilon(1e-3));
    }
}

TEST_CASE("explicit: substeps are stable where a body is stretched, squeezed, sheared or turned over") {
  GlTest gl;
  const glm::dmat3 shear(1, 0, 0, 2, 1, 0, 0, 0, 1);
  const auto along = [](double x, double y, double z) { return glm::dmat3(x, 0, 0, 0, y, 0, 0, 0, z); };
  for (const auto& [material, nu] :
       {std::pair("springs", 0.25), std::pair("springs", 0.45), std::pair("neo-hookean", 0.3),
        std::pair("neo-hookean", 0.45), std::pair("neo-hookean", 0.49), std::pair("smoothed", 0.3),
        std::pair("smoothed", 0.45), std::pair("smoothed", 0.49)})
    for (const glm::dmat3& by : {glm::dmat3(1), along(3, 1, 1), along(3, 0.58, 0.58), along(0.25, 1, 1),
                                 along(0.25, 2, 2), along(1, 0.25, 0.25), along(3, 3, 3), along(1, 3, 3),
                                 along(1.3, 1, 1), along(-1, 1, 1), along(-0.25, 1, 1), shear}) {
      if (material == std::string("springs") && by[0].x < 0) continue;  // what volumes resist then is not counted
      CAPTURE(material);
      CAPTURE(nu);
      CAPTURE(by[0].x);
      CAPTURE(by[1].y);
      Settings settings = soft(material, 0);
      settings.stability = 0.9, settings.poisson_ratio = nu, settings.mass_scaling = 0;
      settings.dt = 0.02;  // so many substeps that rounding up leaves no reserve
      auto model = std::make_shared<Model>(*irregular_block(5, false));
      for (auto& p : model->positions) p = by * p;
      const Sim sim = create_sim(model, settings);
      const ReferenceInput input{*model, sim.system, sim.settings, sim.inverse_masses};
      CHECK(sim.plan.h < stable_step(input, sim.settings.compliance, model->positions, 200));
    }
}

TEST_CASE("explicit: a body that becomes stiffer takes more substeps before it blows up, and fewer after") {
  GlTest gl;
  CHECK(stiffening_for(1, 0.9) == 1);
  CHECK(stiffening_for(3, 0.4) == 1);
  CHECK(stiffening_for(4, 0.7) == 2);
  CHECK(stiffening_for(1e9, 0.4) == 32);
  Settings settings = soft("neo-hookean", 0);
  settings.stability = 0.4, settings.damping = 2;
  // It flies apart, until it is some three times as large.
  auto model = std::make_shared<Model>(*irregular_block(5, false, {0, 0, 0}, {0, 0, 0}));
  const glm::dvec3 centre = centre_of(*model, model->positions);
  double start = 0;
  for (std::size_t i = 0; i < model->positions.size(); ++i) {
    model->velocities[i] = 160.0 * (model->positions[i] - centre);
    start += model->masses[i] / 2 * glm::dot(model->velocities[i], model->velocities[i]);
  }
  std::uint64_t bits = 0;
  for (const int run : {0, 1, 2}) {
    CAPTURE(run);
    Sim sim = create_sim(model, settings);
    const int at_rest = sim.plan.substeps;
    if (run == 0) sim.adaptive.readback = {};  // not watched
    double most = 0;
    Metrics metrics = create_metrics(*model, sim.system);
    for (int s = 0; s < 400; ++s) {
      step(sim);
      measure(metrics, sim);
      most = std::max(most, collect(metrics, true)->kinetic);
    }
    CHECK_FALSE(check_finite(sim, true));
    if (run == 0) CHECK(most > 1.5 * start);
    if (run == 0) continue;
    CHECK(most < start);
    CHECK(sim.adaptive.most_substeps > 1.5 * at_rest);
    CHECK(sim.plan.substeps == at_rest);
    if (run == 1) bits = state_hash(sim);
    CHECK(state_hash(sim) == bits);
  }
  // At rest it stays as it is.
  settings.stability = 0.6, settings.gravity = 0;
  Sim still = create_sim(irregular_block(5, false, {0, 0, 0}, {0, 0, 0}), settings);
  const int first = still.plan.substeps;
  for (int s = 0; s < 20; ++s) step(still);
  CHECK(still.adaptive.most_substeps == first);
  // Also from a start that is deformed already.
  Sim large = create_sim(deformed_block(glm::dvec3(3)), settings), small = create_sim(model, settings);
  CHECK(large.plan.substeps > 2 * small.plan.substeps);
}

TEST_CASE("explicit: the numbers that its longest step starts from are the same with every library") {
  std::mt19937 random(1);
  for (const double expected : {0.9943696164605311, 0.8651147227363309, -0.743751104455388})
    CHECK(draw_unit(random) == expected);
#ifdef __GLIBCXX__
  std::mt19937 other(1);
  other.discard(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int k = 0; k < 100000; ++k) REQUIRE(draw_unit(random) == unit(other));
#endif
}

TEST_CASE("explicit: what has no force is refused in a line") {
  GlTest gl;
  const auto model = irregular_block(1, false);
  Settings hard;
  hard.mode = "explicit";
  CHECK_THROWS_WITH_AS(create_sim(model, hard), doctest::Contains("needs forces, and stretch has none"), Error);
  Settings weak = soft("none", 0);
  weak.stiffness[index_of<Bend>] = 0.5;
  CHECK_THROWS_WITH_AS(create_sim(model, weak), doctest::Contains("bend has none"), Error);
  Sim sim = create_sim(model, soft("none", 0));
  CHECK_THROWS_AS(apply_settings(sim, weak), Error);
  step(sim);  // goes on as it was
  CHECK(sim.settings.mode == "explicit");
}

TEST_CASE("explicit, newton: bodies of linear and of smoothed tets move as each does alone") {
  GlTest gl;
  for (const char* mode : {"explicit", "newton"}) {
    CAPTURE(mode);
    Settings settings = soft("neo-hookean", 0);
    settings.mode = mode, settings.mass_scaling = 0, settings.young_modulus = 1e5;
    const auto model_of = [&](const std::vector<const char*>& elements) {
      auto model = std::make_shared<Model>();
      for (const char* element : elements) {
        const auto block = irregular_block(1, true);
        add_body(*model, element, block->rest, 1000, block->positions, {}, {}, {0, 1});
      }
      return model;
    };
    const auto moved = [&](const std::vector<const char*>& elements) {
      Settings own = settings;
      for (const char* element : elements) {
        own.bodies.push_back({.material = settings});
        own.bodies.back().material->element = element;
      }
      Sim sim = create_sim(model_of(elements), own);
      for (int s = 0; s < 20; ++s) step(sim);
      return read_state(sim).positions;
    };
    const auto linear = moved({"linear"}), smoothed = moved({"smoothed"}),
               both = moved({"linear", "smoothed", "linear"});
    const std::size_t n = linear.size();
    double apart = 0, far = 0;
    for (std::size_t i = 0; i < n; ++i) {
      apart = std::max({apart, glm::distance(both[i], linear[i]), glm::distance(both[n + i], smoothed[i]),
                        glm::distance(both[2 * n + i], linear[i])});
      far = std::max(far, glm::distance(linear[i], smoothed[i]));
    }
    CHECK(apart < 2e-3 * far);
    CHECK(far > 1e-3);
  }
}

TEST_CASE("explicit: the same bits every time, however the mesh is cut") {
  GlTest gl;
  const auto model = irregular_block(0.01, true);
  for (const char* material : {"neo-hookean", "smoothed"}) {
    std::uint64_t bits = 0;
    for (const unsigned patch : {0u, 0u, 5u, 24u, 200u}) {
      CAPTURE(material);
      CAPTURE(patch);
      Sim sim = create_sim(model, soft(material, 1e-3), {.group = patch ? 256u : 0u, .patch = patch});
      for (int s = 0; s < 10; ++s) step(sim);
      if (!bits) bits = state_hash(sim);
      CHECK(state_hash(sim) == bits);
    }
  }
}

TEST_CASE("explicit: a body swings on where another mode left it, and another where it did") {
  GlTest gl;
  // In free fall, so that the place is known: the velocities of one mode are those of the other's substeps.
  auto settings = soft("neo-hookean", 0);
  settings.damping = 0;
  const auto model = irregular_block(5, false);
  Sim sim = create_sim(model, settings);
  const auto centre = [&] { return centre_of(*model, read_state(sim).positions).y; };
  const double start = centre();
  double time = 0;
  for (const char* mode : {"explicit", "node", "explicit", "cpu-fast", "explicit"}) {
    settings.mode = mode, settings.substeps = 7;
    apply_settings(sim, settings);
    for (int s = 0; s < 10; ++s) step(sim), time += settings.dt;
    CHECK(std::abs(centre() - (start - 9.81 / 2 * time * time)) < 2e-5);
  }
}

namespace {

// A block in whose middle one vertex stands so near another that their tets set the longest step.
std::shared_ptr<Model> block_with_sliver(bool held) {
  TetMesh mesh = make_block({1, 0.5, 0.5}, {16, 8, 8});
  std::size_t middle = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (glm::length(mesh.positions[v]) < glm::length(mesh.positions[middle])) middle = v;
  mesh.positions[middle].x += 0.0575;  // of an edge of 0.0625
  finish_tets(mesh, "block");
  std::vector<std::uint32_t> fixed;
  for (std::uint32_t v = 0; v < mesh.positions.size() && held; ++v)
    if (mesh.positions[v].x < -0.49) fixed.push_back(v);
  auto model = std::make_shared<Model>();
  add_body(*model, "block", mesh, 1000, mesh.positions, glm::dvec3(0), held ? glm::dvec3(0) : glm::dvec3(1, 2, 3),
           fixed);
  return model;
}

Settings scaled_by(double share) {
  Settings s;
  s.mode = "explicit", s.material = "neo-hookean", s.young_modulus = 1e5, s.ground = false, s.mass_scaling = share;
  return s;
}

double total(const std::vector<double>& masses) {
  double sum = 0;
  for (const double m : masses) sum += m;
  return sum;
}

}  // namespace

TEST_CASE_FIXTURE(GlTest, "mass scaling: substeps get longer for a hundredth of the mass, and the motion stays") {
  const auto model = block_with_sliver(true);
  Sim plain = create_sim(model, scaled_by(0)), heavier = create_sim(model, scaled_by(0.01));
  CHECK(plain.masses == model->masses);
  CHECK(plain.mass_scaling.gain == 1);
  const MassScaling& told = heavier.mass_scaling;
  CHECK(told.gain > 2);
  CHECK(told.added <= 0.01 * total(model->masses));
  CHECK(told.added == doctest::Approx(total(heavier.masses) - total(model->masses)));
  CHECK(told.vertices > 0);
  CHECK(told.vertices < model->masses.size() / 10);
  CHECK(heavier.longest_substep > 1.99 * plain.longest_substep);
  CHECK(heavier.plan.substeps < 0.6 * plain.plan.substeps);
  for (std::size_t v = 0; v < model->masses.size(); ++v) CHECK(heavier.masses[v] >= model->masses[v]);
  for (int s = 0; s < 60; ++s) step(plain), step(heavier);
  const State right = read_state(plain), state = read_state(heavier);
  CHECK(error_to(*model, right, state) < 1e-3);
  CHECK(error_to(*model, right, {model->positions, {}}) > 0.05);
}

TEST_CASE_FIXTURE(GlTest, "mass scaling: gravity stays an acceleration, momenta are those of the masses that move") {
  const auto model = block_with_sliver(false);
  Sim sim = create_sim(model, scaled_by(0.01));
  REQUIRE(sim.mass_scaling.gain > 2);
  Metrics metrics = create_metrics(sim);
  const Measurement start = measure_now(metrics, sim);
  for (int s = 0; s < 60; ++s) step(sim);
  const Measurement end = measure_now(metrics, sim);
  const double t = 60 * sim.settings.dt, mass = total(sim.masses);
  const double speed = start.momentum.y / mass - 9.81 * sim.plan.h / 2;  // the spin is not about the heavier centre
  CHECK(end.centre.y - start.centre.y == doctest::Approx(speed * t - 0.5 * 9.81 * t * t).epsilon(1e-4));
  CHECK((end.momentum.y - start.momentum.y) / mass == doctest::Approx(-9.81 * t).epsilon(1e-5));
  CHECK(glm::length(end.angular_momentum - start.angular_momentum) < 1e-4 * glm::length(start.angular_momentum));
  CHECK(end.total == doctest::Approx(start.total).epsilon(1e-3));
}

TEST_CASE_FIXTURE(GlTest, "mass scaling: it is left out where it gains little, and follows settings and pins") {
  CHECK(create_sim(irregular_block(1, false), scaled_by(0.01)).mass_scaling.vertices == 0);
  const auto model = block_with_sliver(false);
  Sim sim = create_sim(model, scaled_by(0.01));
  std::size_t heaviest = 0;
  for (std::size_t v = 0; v < model->masses.size(); ++v)
    if (sim.masses[v] / model->masses[v] > sim.masses[heaviest] / model->masses[heaviest]) heaviest = v;
  pin(sim, std::uint32_t(heaviest));
  apply_settings(sim, scaled_by(0));
  CHECK(sim.masses == model->masses);
  CHECK(is_pinned(sim, std::uint32_t(heaviest)));
  unpin(sim, std::uint32_t(heaviest));
  CHECK(sim.inverse_masses == model->inverse_masses);
  apply_settings(sim, scaled_by(0.01));
  CHECK(sim.inverse_masses[heaviest] == doctest::Approx(1 / sim.masses[heaviest]));
  const auto positions = sim.positions.read_all<Position>();
  CHECK(positions[heaviest].inverse_mass == float(sim.inverse_masses[heaviest]));
  for (int s = 0; s < 40; ++s) step(sim);
  CHECK(!check_finite(sim, true));
}
