// The reference at rest and over many steps, against closed forms.
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

TEST_CASE("a hanging chain stretches by the sum of segment forces times compliance") {
  const int n = 12;
  std::vector<glm::dvec3> positions;
  std::vector<double> inverse_masses;
  for (int i = 0; i <= n; ++i) {
    positions.emplace_back(0.3, -0.1 * i - 0.002 * i * i, -0.2);
    inverse_masses.push_back(i == 0 ? 0 : 1 / (0.5 + 0.1 * i));
  }
  const Scene scene = chain_scene(positions, inverse_masses);
  for (double alpha : {1e-7, 1e-4, 1e-3}) {
    CAPTURE(alpha);
    std::vector<double> expected(positions.size(), positions[0].y);
    for (std::size_t i = 1; i < positions.size(); ++i) {
      double below = 0;
      for (std::size_t j = i; j < positions.size(); ++j) below += scene.model.masses[j] * scene.settings.gravity;
      expected[i] = expected[i - 1] + positions[i].y - positions[i - 1].y - alpha * below;
    }
    const double sag = positions.back().y - expected.back();
    for (double sideways : {0.0, 0.03}) {  // hung straight or let go from aside
      auto start = positions;
      generator.seed(2);
      for (std::size_t i = 1; i < start.size(); ++i) start[i] += noise(sideways);
      const ReferenceStep rest = static_equilibrium(scene.input(), start, {alpha, infinity, infinity});
      for (std::size_t i = 0; i < start.size(); ++i) {
        const glm::dvec3 at = rest.state.positions[i];
        CHECK(std::abs(at.y - expected[i]) < 1e-6 * sag);
        CHECK(std::hypot(at.x - 0.3, at.z + 0.2) < 1e-6);
        CHECK(rest.state.velocities[i] == glm::dvec3(0));
      }
    }
  }
}

TEST_CASE(
    "a block hung by one end with all constraints: its holders carry its weight, and it hangs lower when "
    "softer") {
  Scene scene = block_scene({4, 2, 2});
  double lowest = infinity, weight = 0;
  std::vector<std::size_t> held;
  for (std::size_t i = 0; i < scene.model.positions.size(); ++i) {
    if (scene.model.rest.positions[i].x < -0.45)
      scene.model.inverse_masses[i] = 0, held.push_back(i);
    else
      weight += scene.model.masses[i] * scene.settings.gravity;
  }
  CHECK(held.size() == 9);
  for (double scale : {1e-3, 1.0, 30.0}) {
    CAPTURE(scale);
    const Compliances compliances{1e-6 * scale, 1e-4 * scale, 1e-8 * scale};
    const ReferenceStep rest = static_equilibrium(scene.input(), scene.model.positions, compliances);
    const auto forces =
        gradient(static_objective(scene.input(), scene.model.positions, compliances), rest.state.positions);
    glm::dvec3 reaction(0);
    for (std::size_t i : held) {
      reaction += forces[i];
      CHECK(rest.state.positions[i] == scene.model.positions[i]);
    }
    CHECK(glm::length(reaction - glm::dvec3(0, weight, 0)) < 1e-6 * weight);
    const double tip = centre_of(scene.model, rest.state.positions).y;
    CHECK(tip < lowest);
    lowest = tip;
  }
  scene.model.inverse_masses = block_scene({4, 2, 2}).model.inverse_masses;
  CHECK_THROWS_AS(static_equilibrium(scene.input(), scene.model.positions, {1e-6, 1e-4, 1e-8}), Error);
  scene.model.inverse_masses[0] = 0;  // by one vertex: it can turn about the vertical, so no place is its own
  CHECK_THROWS_AS(static_equilibrium(scene.input(), scene.model.positions, {1e-6, 1e-4, 1e-8}), Error);
}

TEST_CASE("a clamped bar vibrates at the frequency of its springs and masses") {
  // Fixed at one end, free at the other, n masses m and springs k: omega = 2 sqrt(k/m) sin(pi / (2 (2n +
  // 1))); with the last mass halved, as lumping a bar gives it, 2 sqrt(k/m) sin(pi / (4 n)). Mode shapes
  // sin(i theta).
  const int n = 10;
  const double m = 0.2, alpha = 1e-4;
  for (bool half : {false, true}) {
    CAPTURE(half);
    std::vector<glm::dvec3> positions;
    std::vector<double> inverse_masses(n + 1, 1 / m);
    for (int i = 0; i <= n; ++i) positions.emplace_back(0.1 * i, 0, 0);
    inverse_masses[0] = 0;
    if (half) inverse_masses[n] = 2 / m;
    Scene scene = chain_scene(positions, inverse_masses);
    const double angle = half ? pi / (2 * n) : pi / (2 * n + 1);
    const double omega = 2 / std::sqrt(alpha * m) * std::sin(angle / 2), period = 2 * pi / omega;
    scene.settings.gravity = 0;
    const double h = scene.settings.dt = period / 400;
    State state = scene.start();
    // Amplitude 1e-5 of the length: springs in compression have a negative stiffness across the bar, which
    // inertia outweighs.
    for (int i = 1; i <= n; ++i) state.positions[std::size_t(i)].x += 1e-5 * std::sin(angle * i);
    std::vector<double> crossings;
    double before = 1;
    for (int s = 0; s < 800; ++s) {
      state = implicit_euler_step(scene.input(), state, {alpha, infinity, infinity}).state;
      const double now = state.positions[n].x - positions[n].x;
      if (before < 0 && now >= 0) crossings.push_back(s - now / (now - before));
      before = now;
    }
    REQUIRE(crossings.size() == 2);
    const double measured = 2 * pi / ((crossings[1] - crossings[0]) * h);
    CHECK(measured == doctest::Approx(omega).epsilon(0.01));
    CHECK(measured == doctest::Approx(std::atan(omega * h) / h).epsilon(1e-5));  // backward Euler's own
  }
}
