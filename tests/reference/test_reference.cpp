// The reference answers of a step against closed forms, and PBD's iterations against them.
#include "sim/solvers/cpu_pbd.h"
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

// ----------------------------------------------------------------------------------------------------------
// rigid step

TEST_CASE("the rigid step has no strain, keeps linear momentum, and is the nearest rigid placement") {
  const Scene scene = block_scene();
  State state = scene.start();
  const glm::dvec3 gravity(0, -scene.settings.gravity, 0);
  const double h = scene.settings.dt;
  for (int s = 1; s <= 20; ++s) {
    const State before = state;
    state = rigid_step(scene.input(), state);
    const Errors e = errors_of(scene, state.positions);
    CHECK(e.strain < 1e-13);
    CHECK(e.volume < 1e-12);
    CHECK(e.angle < 1e-12);
    const glm::dvec3 was = centre_of(scene.model, before.velocities), now = centre_of(scene.model, state.velocities);
    CHECK(glm::length(now - was - h * gravity) < 1e-12);
    CHECK(largest_distance(state.velocities, before.velocities) > 1e-3);  // it does act
    for (std::size_t i = 0; i < state.positions.size(); ++i)
      CHECK(glm::length((state.positions[i] - before.positions[i]) / h - state.velocities[i]) < 1e-11);

    // No torque about the centre of the placement: sum m p x y = 0, so the angular momentum about the new
    // positions is that of the old velocities there. And no rigid placement nearby is nearer.
    const glm::dvec3 centre = centre_of(scene.model, state.positions);
    glm::dvec3 torque(0), angular(0), expected(0);
    double nearest = 0;
    std::vector<glm::dvec3> y;
    for (std::size_t i = 0; i < state.positions.size(); ++i) {
      const double m = scene.model.masses[i];
      const glm::dvec3 r = state.positions[i] - centre;
      y.push_back(before.positions[i] + h * (before.velocities[i] + h * gravity));
      torque += m * glm::cross(r, y[i] - centre);
      angular += m * glm::cross(r, state.velocities[i]);
      expected += m * glm::cross(r, before.velocities[i]);
      nearest += m * glm::dot(state.positions[i] - y[i], state.positions[i] - y[i]);
    }
    CHECK(glm::length(torque) < 1e-10);
    CHECK(glm::length(angular - expected) < 1e-9 * glm::length(expected));
    for (int trial = 0; trial < 10; ++trial) {
      const glm::dvec3 axis = glm::normalize(noise(1)), shift = noise(1e-4);
      double other = 0;
      for (std::size_t i = 0; i < y.size(); ++i) {
        const glm::dvec3 r = state.positions[i] - centre, side = glm::cross(axis, r), along = axis * glm::dot(axis, r);
        const glm::dvec3 p = centre + shift + along + (r - along) * std::cos(1e-3) + side * std::sin(1e-3);
        other += scene.model.masses[i] * glm::dot(p - y[i], p - y[i]);
      }
      CHECK(other > nearest);
    }
  }
}

TEST_CASE("a body spinning about a main axis slows down exactly as first order does") {
  // Equal masses make x, y, z main axes. A step turns by phi with tan phi = h omega, then
  // tan phi' = sin phi / (2 - cos phi); the angular momentum after a step is I sin(phi) / h.
  Scene scene = block_scene({4, 3, 2}, 0);
  Model& model = scene.model;
  for (auto* list : {&model.masses, &model.inverse_masses}) list->assign(list->size(), 1.0);
  scene.settings.gravity = 0;
  const glm::dvec3 centre = centre_of(model, model.positions);
  double inertia = 0;
  for (std::size_t i = 0; i < model.positions.size(); ++i) {
    const glm::dvec3 r = model.positions[i] - centre;
    inertia += r.x * r.x + r.y * r.y;
    model.velocities[i] = glm::cross(glm::dvec3(0, 0, 10), r);
  }
  State state = scene.start();
  const double h = scene.settings.dt;
  double phi = std::atan(10 * h), last = 10 * inertia;
  for (int s = 0; s < 50; ++s) {
    state = rigid_step(scene.input(), state);
    glm::dvec3 angular(0);
    for (std::size_t i = 0; i < state.positions.size(); ++i)
      angular += glm::cross(state.positions[i] - centre, state.velocities[i]);
    CHECK(angular.z == doctest::Approx(inertia * std::sin(phi) / h).epsilon(1e-11));
    CHECK(std::hypot(angular.x, angular.y) < 1e-9 * inertia);
    CHECK(angular.z < last);
    last = angular.z;
    phi = std::atan2(std::sin(phi), 2 - std::cos(phi));
  }
}

TEST_CASE("the rigid step never mirrors, and refuses what it cannot answer") {
  Scene scene = block_scene();
  State state = scene.start();
  for (auto& p : state.positions) p.z *= -1;  // mirrored: the placement nearest to it is still a turned one
  CHECK(errors_of(scene, rigid_step(scene.input(), state).positions).volume < 1e-12);

  state.positions.assign(state.positions.size(), glm::dvec3(0, 1, 0));
  state.velocities.assign(state.positions.size(), glm::dvec3(0));
  CHECK_THROWS_AS(rigid_step(scene.input(), state), Error);
  state = scene.start();
  for (auto& p : state.positions) p.y -= 1.4;  // in the ground
  CHECK_THROWS_AS(rigid_step(scene.input(), state), Error);
  scene.settings.ground = false;
  CHECK_NOTHROW(rigid_step(scene.input(), state));
  scene.model.inverse_masses[3] = 0;
  CHECK_THROWS_AS(rigid_step(scene.input(), scene.start()), Error);
}

// ------------------------------------------------------------------------------------------------------
// implicit Euler

TEST_CASE("the gradient is the energy's, also where hinges have turned further than 1 rad") {
  for (double amplitude : {1e-3, 0.05, 0.3}) {
    CAPTURE(amplitude);
    const Scene scene = block_scene();
    const Objective o = step_objective(scene.input(), scene.start(), {1e-5, 1e-3, 1e-7}, 0.005);
    generator.seed(3);
    auto x = scene.model.positions;
    for (auto& p : x) p += noise(amplitude);
    if (amplitude == 0.3) CHECK(errors_of(scene, x).angle == 1);  // the clamp of the formula
    const auto g = gradient(o, x);
    const double norm = std::sqrt(dot(g, g));
    for (int trial = 0; trial < 20; ++trial) {
      std::vector<glm::dvec3> direction, low = x, high = x;
      const double step = 1e-6;
      for (std::size_t i = 0; i < x.size(); ++i) {
        direction.push_back(noise(1));
        low[i] -= step * direction[i], high[i] += step * direction[i];
      }
      const double difference = (energy(o, high) - energy(o, low)) / (2 * step);
      CHECK(std::abs(difference - dot(g, direction)) < 1e-5 * norm);
    }
  }
}

TEST_CASE("the implicit-Euler step does not depend on the starting guess and is a minimum") {
  for (const Compliances& compliances :
       {Compliances{1e-6, 1e-4, 1e-8}, Compliances{1e-4, 1e-2, 1e-6}, Compliances{1e-3, infinity, infinity}}) {
    CAPTURE(compliances[0]);
    const Scene scene = block_scene();
    const ReferenceStep step = implicit_euler_step(scene.input(), scene.start(), compliances);
    CHECK(step.residual <= minimum_tolerance);
    CHECK(step.iterations > 1);  // not the prediction alone
    const auto& x = step.state.positions;
    generator.seed(5);
    for (double amplitude : {0.0, 0.02, 0.05}) {
      auto guess = scene.model.positions;
      for (auto& p : guess) p += noise(amplitude);
      const ReferenceStep other = implicit_euler_step(scene.input(), scene.start(), compliances, &guess);
      CHECK(largest_distance(other.state.positions, x) < 1e-9 * scene.model.size);
      CHECK(largest_distance(other.state.positions, guess) > 1e-4 * scene.model.size);
    }
    CHECK(implicit_euler_step(scene.input(), scene.start(), compliances, &x).iterations == 1);  // the guess is used
    // Forces balance: what is left of each is rounding of the forces that cancel.
    const double h = scene.settings.dt;
    const Objective o = step_objective(scene.input(), scene.start(), compliances, h);
    const auto g = gradient(o, x), at_start = gradient(o, o.predicted), at_rest = gradient(o, scene.model.positions);
    CHECK(std::sqrt(dot(g, g)) < 1e-8 * std::sqrt(dot(at_rest, at_rest)));
    CHECK(std::sqrt(dot(g, g)) < 1e-8 * std::sqrt(dot(at_start, at_start)));
    for (double amplitude : {1e-6, 1e-4, 1e-2})
      for (int trial = 0; trial < 20; ++trial) {
        auto moved = x;
        for (auto& p : moved) p += noise(amplitude);
        CHECK(energy(o, moved) > energy(o, x));
      }
    // Velocities are those the positions moved with.
    for (std::size_t i = 0; i < x.size(); ++i)
      CHECK(glm::length((x[i] - scene.model.positions[i]) / h - step.state.velocities[i]) < 1e-10);
  }
}

TEST_CASE("the implicit-Euler step approaches the rigid step as compliance vanishes") {
  const Scene scene = block_scene();
  const State rigid = rigid_step(scene.input(), scene.start());
  double last = infinity;
  for (double alpha : {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9}) {
    CAPTURE(alpha);
    const ReferenceStep step = implicit_euler_step(scene.input(), scene.start(), {alpha, alpha, alpha});
    const double error = error_to(scene.model, rigid, step.state);
    CHECK(error < last);
    if (alpha < 2e-5) CHECK(error == doctest::Approx(0.1 * last).epsilon(0.3));  // linear in alpha
    last = error;
  }
  CHECK(last < 1e-6);
}

TEST_CASE("a spring of two vertices has the closed-form step") {
  // Relative motion: mu/h^2 (r - r0) + (r - d)/alpha = 0 with the reduced mass mu.
  const double m0 = 2, m1 = 3, d = 0.5, r0 = 0.8, mu = m0 * m1 / (m0 + m1);
  for (double alpha : {1e-8, 1e-4, 1e-1, 1e3}) {
    Scene scene = chain_scene({{100, 1, 2}, {100 + d, 1, 2}}, {1 / m0, 1 / m1});
    scene.settings.gravity = 0;
    const double h = scene.settings.dt = 0.01;
    State state = scene.start();
    state.positions[1].x = 100 + r0;
    const ReferenceStep step = implicit_euler_step(scene.input(), state, {alpha, infinity, infinity});
    const double r = (mu / (h * h) * r0 + d / alpha) / (mu / (h * h) + 1 / alpha);
    const double centre = 100 + m1 * r0 / (m0 + m1);
    CHECK(std::abs(step.state.positions[0].x - (centre - m1 / (m0 + m1) * r)) < 1e-9 * d);
    CHECK(std::abs(step.state.positions[1].x - (centre + m0 / (m0 + m1) * r)) < 1e-9 * d);
    CHECK(step.state.velocities[0].x * m0 == doctest::Approx(-step.state.velocities[1].x * m1).epsilon(1e-6));
    CHECK(std::abs(step.state.positions[1].y - 1) + std::abs(step.state.positions[1].z - 2) < 1e-12);
  }
}

TEST_CASE("fixed vertices stay, substeps and damping are those of the solvers") {
  Scene scene = block_scene();
  scene.model.inverse_masses[0] = scene.model.inverse_masses[7] = 0;
  scene.model.velocities[0] = scene.model.velocities[7] = glm::dvec3(0);
  const ReferenceStep step = implicit_euler_step(scene.input(), scene.start(), {1e-6, 1e-4, 1e-8});
  for (std::size_t i : {std::size_t(0), std::size_t(7)}) {
    CHECK(step.state.positions[i] == scene.model.positions[i]);
    CHECK(step.state.velocities[i] == glm::dvec3(0));
  }
  CHECK(largest_distance(step.state.positions, scene.model.positions) > 1e-4);
  auto guess = scene.model.positions;
  for (auto& p : guess) p.x += 0.01;  // a guess does not move them either
  const State guessed = implicit_euler_step(scene.input(), scene.start(), {1e-6, 1e-4, 1e-8}, &guess).state;
  CHECK(largest_distance(guessed.positions, step.state.positions) < 1e-9 * scene.model.size);

  // Without constraints every solver's step is the prediction.
  Settings& settings = scene.settings;
  settings.substeps = 4, settings.damping = 3, settings.ground = false, settings.constraints = "";
  scene.system = build_constraints(scene.model.rest, "");
  State state = scene.start();
  CpuPbd<double>(scene.model, scene.system).step(state, settings, scene.model.inverse_masses, Sweep::jacobi);
  const State free = implicit_euler_step(scene.input(), scene.start(), {1, 1, 1}).state;
  CHECK(largest_distance(free.positions, state.positions) < 1e-14);
  CHECK(largest_distance(free.velocities, state.velocities) < 1e-12);
  settings.substeps = 1;
  CHECK(largest_distance(implicit_euler_step(scene.input(), scene.start(), {1, 1, 1}).state.positions,
                         state.positions) > 1e-6);

  Scene bent = block_scene();
  for (double wrong : {0.0, -1.0, std::nan("")})
    CHECK_THROWS_AS(implicit_euler_step(bent.input(), bent.start(), {1, wrong, 1}), Error);
  state.positions[4].x = std::nan("");
  CHECK_THROWS_AS(implicit_euler_step(scene.input(), state, {1, 1, 1}), Error);
}
// ------------------------------------------------------------------------------------------------------
// PBD and comparisons

// A block of 80 vertices, k = 1. Distance to the rigid step over the prediction's (0.0036 of the size); RMS
// strain and relative volume error (prediction: 0.017, 0.036); largest angle error in rad:
//   iterations   Jacobi, omega 1.5                      Gauss-Seidel
//           10   0.41     4.5e-3   6.3e-3   2.1e-2      0.013    6.1e-5   4.5e-5   3.6e-4
//          100   0.072    3.5e-4   2.3e-4   1.5e-3      0.00070  5.3e-12  3.9e-12  3.3e-11
//         1000   0.0236   1.3e-6   9.4e-7   8.2e-6      0.00070  5e-16    8e-16    0
//        10000   0.0236   8e-15    6e-15    6e-14       0.00070  5e-16    8e-16    0
// So PBD ends in a rigid placement, but not in the nearest one: each correction is along gradients of its own
// positions, not of the end's, and Jacobi's averages besides do not keep momentum.
TEST_CASE("PBD's iterations end in a rigid placement near the reference, not in it") {
  Scene scene = block_scene({4, 3, 3});
  CHECK(scene.model.positions.size() == 80);
  scene.settings.ground = scene.settings.rigid_contact = false;
  const State rigid = rigid_step(scene.input(), scene.start());
  const glm::dvec3 gravity(0, -scene.settings.gravity, 0);
  State predicted = scene.start();
  for (std::size_t i = 0; i < predicted.positions.size(); ++i)
    predicted.positions[i] += scene.settings.dt * (predicted.velocities[i] + scene.settings.dt * gravity);
  const double start = error_to(scene.model, rigid, predicted);
  CHECK(start > 1e-3);
  for (Sweep sweep : {Sweep::jacobi, Sweep::gauss_seidel}) {
    CAPTURE(int(sweep));
    CpuPbd<double> pbd(scene.model, scene.system);
    Errors last = errors_of(scene, predicted.positions);
    double last_distance = start, defect = 0;
    for (int iterations : {10, 100, 1000, 10000}) {
      CAPTURE(iterations);
      scene.settings.iterations = iterations;
      State state = scene.start();
      pbd.step(state, scene.settings, scene.model.inverse_masses, sweep);
      const Errors now = errors_of(scene, state.positions);
      CHECK(now.strain < std::max(0.3 * last.strain, 1e-13));
      CHECK(now.volume < std::max(0.3 * last.volume, 1e-13));
      CHECK(now.angle < std::max(0.3 * last.angle, 1e-12));
      defect = error_to(scene.model, rigid, state);
      CHECK(defect < last_distance * (1 + 1e-9));
      last = now, last_distance = defect;
    }
    CHECK(last.strain < 1e-12);
    CHECK(last.volume < 1e-12);
    CHECK(last.angle < 1e-11);
    CHECK(defect < (sweep == Sweep::jacobi ? 0.05 : 0.002) * start);
    CHECK(defect > 1e-5 * start);  // were it 0, the reference would be PBD itself
  }
}

TEST_CASE("the error to a reference is the RMS distance by mass over the body's size") {
  const Scene scene = block_scene();
  const State a = scene.start();
  State b = a;
  CHECK(error_to(scene.model, a, b) == 0);
  for (auto& p : b.positions) p += glm::dvec3(0.3, 0, 0.4);
  CHECK(error_to(scene.model, a, b) == doctest::Approx(0.5 / scene.model.size));
  b = a;
  b.positions[5].y += 2;
  double mass = 0;
  for (double m : scene.model.masses) mass += m;
  CHECK(error_to(scene.model, a, b) == doctest::Approx(2 * std::sqrt(scene.model.masses[5] / mass) / scene.model.size));
  b.positions[5].y = std::nan("");
  CHECK(std::isnan(error_to(scene.model, a, b)));
}
