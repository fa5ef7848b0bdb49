// The error measures give hand-computed values, on the GPU, and agree with the same sums in double.
#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <cmath>

#include "sim/measure/metrics.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

std::shared_ptr<Model> model_of(TetMesh mesh, double lift = 2) {
  for (auto& p : mesh.positions) p.y += lift;
  auto model = std::make_shared<Model>();
  add_body(*model, "body", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  return model;
}

TetMesh one_tet() {
  TetMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.tets = {{0, 1, 2, 3}};
  finish_tets(mesh, "tet");
  return mesh;
}

Measurement measure_state(const std::shared_ptr<Model>& model, const State& state) {
  Settings settings;
  settings.iterations = 25, settings.substeps = 1;
  settings.ground = false;
  Sim sim = create_sim(model, settings);
  write_state(sim, state);
  Metrics metrics = create_metrics(*model);
  return measure_now(metrics, sim);
}

}  // namespace

TEST_CASE("a rigid motion has no error, wherever it goes") {
  GlTest gl;
  const auto model = model_of(make_block({1, 0.7, 0.5}, {5, 4, 3}));
  for (double angle : {0.0, 0.3, 1.5707963, 2.9, 3.1415926}) {
    for (glm::dvec3 axis : {glm::dvec3(0, 1, 0), glm::dvec3(1, -2, 0.5)}) {
      CAPTURE(angle);
      axis = glm::normalize(axis);
      State state{model->positions, model->velocities};
      for (auto& p : state.positions)
        p = p * std::cos(angle) + glm::cross(axis, p) * std::sin(angle) +
            axis * glm::dot(axis, p) * (1 - std::cos(angle)) + glm::dvec3(30, -7, 4);
      const Measurement m = measure_state(model, state);
      CHECK(std::abs(m.volume_error_percent) < 1e-4);
      CHECK(m.tet_volume_max < 1e-5);
      CHECK(m.stretch_max < 1e-6);
      CHECK(m.bend_rms_rad < 2e-6);
      CHECK(m.rigid_distance < 1e-6);
      CHECK(m.inverted_tets == 0);
      CHECK(m.finite());
    }
  }
}

TEST_CASE("elastic energy is what the material says, and becomes motion") {
  GlTest gl;
  const auto model = model_of(make_block({1, 0.7, 0.5}, {4, 3, 3}));
  for (const char* name : {"neo-hookean", "springs", "smoothed"}) {
    CAPTURE(name);
    Settings settings;
    settings.mode = "explicit";
    const bool smoothed = name == std::string("smoothed");
    if (smoothed) settings.element = "smoothed";
    settings.material = smoothed ? "neo-hookean" : name, settings.young_modulus = 1e5, settings.poisson_ratio = 0.3;
    settings.ground = false, settings.gravity = 0;
    settings.stability = 0.1;  // leapfrog swings about the energy by the square of its step
    Sim sim = create_sim(model, settings);
    Metrics metrics = create_metrics(*model);
    CHECK(std::abs(measure_now(metrics, sim).elastic) < 1e-2);
    State state{model->positions, model->velocities};
    for (auto& p : state.positions) p.x *= 1.02;
    write_state(sim, state);
    const double start = measure_now(metrics, sim).elastic;
    // Pulled along x with the sides held: E (1 - nu) / ((1 + nu) (1 - 2 nu)). Springs are isotropic on
    // average only.
    if (settings.material == "neo-hookean")
      CHECK(start == doctest::Approx(0.35 * 0.5 * 1e5 * 0.7 / (1.3 * 0.4) * 0.02 * 0.02).epsilon(0.01));
    double moving = 0;
    for (int i = 0; i < 40; ++i) {
      step(sim);
      const Measurement now = measure_now(metrics, sim);
      moving = std::max(moving, now.kinetic);
      CHECK(now.energy() + now.elastic == doctest::Approx(start).epsilon(0.04));
    }
    CHECK(moving > 0.3 * start);
  }
}

TEST_CASE("a body scaled by s has volume error s^3 - 1 and strain s - 1") {
  GlTest gl;
  const auto model = model_of(make_block({1, 0.7, 0.5}, {5, 4, 3}));
  for (double s : {0.5, 0.9, 1.2}) {
    State state{model->positions, model->velocities};
    for (auto& p : state.positions) p *= s;
    const Measurement m = measure_state(model, state);
    CHECK(m.volume_error_percent == doctest::Approx(100 * (s * s * s - 1)).epsilon(1e-5));
    CHECK(m.tet_volume_rms == doctest::Approx(std::abs(s * s * s - 1)).epsilon(1e-5));
    CHECK(m.stretch_rms == doctest::Approx(std::abs(s - 1)).epsilon(1e-5));
    CHECK(m.stretch_max == doctest::Approx(std::abs(s - 1)).epsilon(1e-5));
    CHECK(m.bend_rms_rad < 2e-6);
    CHECK(m.rigid_distance > 0.1 * std::abs(s - 1));
  }
}

TEST_CASE("a stretched spring, a folded hinge and a squeezed tet give what a hand computes") {
  GlTest gl;
  const auto model = model_of(one_tet(), 0);
  State state{model->positions, model->velocities};
  state.positions[3] = {0, 0, 0.5};  // half the height: half the volume; edge 0-3 halved, edges 1-3 and 2-3 shortened
  const Measurement m = measure_state(model, state);
  CHECK(m.volume_error_percent == doctest::Approx(-50));
  CHECK(m.tet_volume_rms == doctest::Approx(0.5));
  const double slope = std::sqrt(1.25) / std::sqrt(2.0) - 1;
  CHECK(m.stretch_rms == doctest::Approx(std::sqrt((0.25 + 2 * slope * slope) / 6)).epsilon(1e-5));
  CHECK(m.stretch_max == doctest::Approx(0.5));
  // Hinges 0-1 and 0-2 and 0-3 stay at 90 degrees; the other three change.
  const auto angle = [](glm::dvec3 n1, glm::dvec3 n2) {
    return std::acos(glm::dot(glm::normalize(n1), glm::normalize(n2)));
  };
  const glm::dvec3 slanted_before(1, 1, 1), slanted_after(1, 1, 2);
  double squares = 0;
  for (glm::dvec3 side : {glm::dvec3(-1, 0, 0), glm::dvec3(0, -1, 0), glm::dvec3(0, 0, -1)})
    squares += std::pow(angle(side, slanted_after) - angle(side, slanted_before), 2);
  CHECK(m.bend_rms_rad == doctest::Approx(std::sqrt(squares / 6)).epsilon(1e-4));
  state.positions[3].z = -1;
  const Measurement inverted = measure_state(model, state);
  CHECK(inverted.inverted_tets == 1);
  CHECK(inverted.volume_error_percent == doctest::Approx(-200));
}

TEST_CASE("momentum, energy, contacts and rigid distance agree with sums in double") {
  GlTest gl;
  const auto model = model_of(make_block({1, 0.7, 0.5}, {6, 4, 3}), 0.35);
  State state{model->positions, model->velocities};
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    const double t = double(i);
    state.positions[i] += 0.03 * glm::dvec3(std::sin(t), std::abs(std::sin(2 * t)), std::sin(3 * t));
    if (model->positions[i].y < 1e-9) state.positions[i].y = 0;
    state.velocities[i] = {std::cos(t), 1 + std::cos(2 * t), 0.3 * t / 140};
  }
  Settings settings;
  settings.iterations = 25, settings.substeps = 1;
  Sim sim = create_sim(model, settings);
  write_state(sim, state);
  Metrics metrics = create_metrics(*model);
  const Measurement m = measure_now(metrics, sim);

  double mass = 0, kinetic = 0, potential = 0, speed = 0, contacts = 0;
  glm::dvec3 centre(0), rest_centre(0), momentum(0), angular(0);
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    const double w = model->masses[i];
    mass += w, centre += w * state.positions[i], rest_centre += w * model->rest.positions[i],
        momentum += w * state.velocities[i];
    kinetic += 0.5 * w * glm::dot(state.velocities[i], state.velocities[i]);
    potential += w * 9.81 * state.positions[i].y, speed += w * glm::length(state.velocities[i]);
    contacts += state.positions[i].y < 1e-6;
  }
  centre /= mass, rest_centre /= mass;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const auto eigen = [](glm::dvec3 v) { return Eigen::Vector3d(v.x, v.y, v.z); };
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    angular += model->masses[i] * glm::cross(state.positions[i] - centre, state.velocities[i] - momentum / mass);
    covariance += model->masses[i] * eigen(state.positions[i] - centre) *
                  eigen(model->rest.positions[i] - rest_centre).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d fix = Eigen::Matrix3d::Identity();
  fix(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Matrix3d rotation = svd.matrixU() * fix * svd.matrixV().transpose();
  double squares = 0;
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    squares +=
        model->masses[i] *
        (eigen(state.positions[i] - centre) - rotation * eigen(model->rest.positions[i] - rest_centre)).squaredNorm();

  CHECK(glm::length(m.momentum - momentum) < 1e-5 * speed);
  CHECK(glm::length(m.angular_momentum - angular) < 1e-5 * speed);
  CHECK(m.speed == doctest::Approx(speed).epsilon(1e-5));
  CHECK(m.kinetic == doctest::Approx(kinetic).epsilon(1e-5));
  CHECK(m.potential == doctest::Approx(potential).epsilon(1e-5));
  CHECK(glm::length(m.centre - centre) < 1e-5);
  CHECK(m.contacts == contacts);
  CHECK(m.contacts > 0);
  CHECK(m.rigid_distance ==
        doctest::Approx(std::sqrt(squares / mass) / bounds(model->rest.positions).size()).epsilon(1e-4));
}

TEST_CASE("several bodies are aligned each for itself") {
  GlTest gl;
  const TetMesh block = make_block({1, 0.5, 0.5}, {3, 2, 2});
  auto model = std::make_shared<Model>();
  for (int k = 0; k < 2; ++k) {
    TetMesh mesh = block;
    for (auto& p : mesh.positions) p += glm::dvec3(0, 1.0 + k, 0);
    add_body(*model, "block", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  }
  State state{model->positions, model->velocities};
  const std::size_t n = block.positions.size();
  for (std::size_t i = n; i < 2 * n; ++i)
    std::swap(state.positions[i].x, state.positions[i].z), state.positions[i].x *= -1;
  Measurement m = measure_state(model, state);  // one turned a quarter: still no error
  CHECK(m.rigid_distance < 1e-6);
  CHECK(m.stretch_max < 1e-6);
  for (std::size_t i = n; i < 2 * n; ++i) state.positions[i] *= 1.1;
  m = measure_state(model, state);
  CHECK(m.volume_error_percent == doctest::Approx(100 * (std::pow(1.1, 3) - 1) / 2).epsilon(1e-4));
}

TEST_CASE("what is not finite is counted, and no drift is reported for a body that touches something") {
  GlTest gl;
  const auto model = model_of(make_block({1, 1, 1}, {2, 2, 2}));
  State state{model->positions, model->velocities};
  state.positions[5].y = std::numeric_limits<double>::quiet_NaN();
  state.velocities[6].x = std::numeric_limits<double>::infinity();
  CHECK(measure_state(model, state).non_finite == 2);
  Settings settings;
  settings.iterations = 25, settings.substeps = 1;
  settings.ground = false;
  Sim sim = create_sim(model, settings);
  RunErrors errors;
  Measurement start, later;
  later.time = 0.5, later.momentum = {10, 0, 0}, later.speed = 100;
  double mass = 0;
  for (double m : model->masses) mass += m;
  later.momentum.y = -9.81 * mass * 0.5;
  add_measurement(errors, start, sim);
  add_measurement(errors, later, sim);
  CHECK(errors.linear_drift == doctest::Approx(0.1));
  later.contacts = 1, later.momentum.x = 50;
  add_measurement(errors, later, sim);
  CHECK(errors.linear_drift == doctest::Approx(0.1));
}

TEST_CASE("measurements come back in order and none is lost when the ring is full") {
  GlTest gl;
  const auto model = model_of(make_block({1, 1, 1}, {1, 1, 1}));
  Settings settings;
  settings.iterations = 25, settings.substeps = 1;
  Sim sim = create_sim(model, settings);
  Metrics metrics = create_metrics(*model);
  std::vector<long> seen;
  for (int s = 0; s < 100; ++s) {
    step(sim);
    measure(metrics, sim);
    if (s % 10 == 9)
      while (const auto m = collect(metrics)) seen.push_back(m->step);
  }
  while (const auto m = collect(metrics, true)) seen.push_back(m->step);
  CHECK(seen.size() == 100);
  CHECK(std::is_sorted(seen.begin(), seen.end()));
}
