// The reference answers against closed forms, against each other, and PBD's iterations against them.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <random>

#include "sim/solvers/cpu_pbd.h"
#include "sim/error.h"
#include "sim/reference/reference.h"

using namespace tetpbd;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double pi = 3.14159265358979323846;

std::mt19937 generator(11);
glm::dvec3 noise(double amplitude) {
  std::uniform_real_distribution<double> unit(-amplitude, amplitude);
  const double x = unit(generator), y = unit(generator), z = unit(generator);
  return {x, y, z};
}

// A model with its constraints and settings, and what the reference takes.
struct Scene {
  Model model;
  ConstraintSystem system;
  Settings settings{.iterations = 25, .substeps = 1};
  ReferenceInput input() const { return {model, system, settings, model.inverse_masses}; }
  State start() const { return {model.positions, model.velocities}; }
};

// Irregular: 3 x 2 x 2 cells have 36 vertices, 4 x 3 x 3 have 80. Free in space, 1 m above the ground.
Scene block_scene(glm::ivec3 cells = {3, 2, 2}, double irregular = 0.02) {
  TetMesh mesh = make_block({1, 0.7, 0.5}, cells);
  generator.seed(11);
  for (auto& p : mesh.positions) p += noise(irregular) + glm::dvec3(0, 1.5, 0);
  finish_tets(mesh, "block");
  Scene scene;
  add_body(scene.model, "block", mesh, 1000, mesh.positions, glm::dvec3(0.5, 1, 0), glm::dvec3(3, -2, 5), {});
  // Deforms as well as turns: 1 m/s is 5 mm a step.
  for (auto& v : scene.model.velocities) v += noise(1);
  scene.system = build_constraints(scene.model.rest, scene.settings.constraints);
  return scene;
}

// Springs along a line from the origin, built by hand: `positions` at rest, a spring from each vertex to the
// next.
Scene chain_scene(const std::vector<glm::dvec3>& positions, const std::vector<double>& inverse_masses) {
  Scene scene;
  scene.settings.ground = false;
  Model& model = scene.model;
  model.rest.positions = model.positions = positions;
  model.velocities.assign(positions.size(), glm::dvec3(0));
  model.inverse_masses = inverse_masses;
  for (double w : inverse_masses) model.masses.push_back(w > 0 ? 1 / w : 0);
  model.size = bounds(positions).size();
  model.bodies.push_back({"chain", 0, positions.size(), 0, 0, 0, 0});
  scene.system.lists.resize(std::size_t(kind_count));
  scene.system.present = {true, false, false};
  scene.system.at_vertex.assign(positions.size(), 2);
  scene.system.lists[0].arity = 2;
  for (std::uint32_t i = 0; i + 1 < positions.size(); ++i)
    scene.system.lists[0].add(std::array{i, i + 1}, glm::length(positions[i + 1] - positions[i]));
  return scene;
}

double dot(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += glm::dot(a[i], b[i]);
  return sum;
}

double largest_distance(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, glm::length(a[i] - b[i]));
  return largest;
}

// RMS of strain (l - d) / d over edges and of (V - V0) / V0 over tets, and the largest angle error in rad.
struct Errors {
  double strain = 0, volume = 0, angle = 0;
};
Errors errors_of(const Scene& scene, const std::vector<glm::dvec3>& x) {
  const auto& edges = scene.system.lists[0];
  Errors e;
  for (std::size_t c = 0; c < edges.count(); ++c)
    e.strain +=
        std::pow(glm::length(x[edges.vertices[2 * c]] - x[edges.vertices[2 * c + 1]]) / edges.rest[c] - 1, 2);
  const auto& tets = scene.system.lists[2];
  TetMesh now{x, {}, {}};
  for (std::size_t c = 0; c < tets.count(); ++c) {
    const std::uint32_t* v = tets.vertices.data() + 4 * c;
    e.volume += std::pow(tet_volume(now, {v[0], v[1], v[2], v[3]}) / tets.rest[c] - 1, 2);
  }
  const auto& hinges = scene.system.lists[1];
  for (std::size_t c = 0; c < hinges.count(); ++c) {
    std::array<glm::dvec3, 4> p;
    for (std::size_t j = 0; j < 4; ++j) p[j] = x[hinges.vertices[4 * c + j]];
    e.angle = std::max(e.angle, std::abs(Bend::evaluate<double>(p.data(), hinges.rest[c]).C));
  }
  e.strain = std::sqrt(e.strain / double(edges.count()));
  e.volume = std::sqrt(e.volume / double(tets.count()));
  return e;
}

glm::dvec3 centre_of(const Model& model, const std::vector<glm::dvec3>& x) {
  glm::dvec3 sum(0);
  double mass = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += model.masses[i] * x[i], mass += model.masses[i];
  return sum / mass;
}

}  // namespace

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
    const glm::dvec3 was = centre_of(scene.model, before.velocities),
                     now = centre_of(scene.model, state.velocities);
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
        const glm::dvec3 r = state.positions[i] - centre, side = glm::cross(axis, r),
                         along = axis * glm::dot(axis, r);
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
  state.positions.pop_back();
  CHECK_THROWS_AS(rigid_step(scene.input(), state), Error);
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
  for (const Compliances& compliances : {Compliances{1e-6, 1e-4, 1e-8}, Compliances{1e-4, 1e-2, 1e-6},
                                         Compliances{1e-3, infinity, infinity}}) {
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
    CHECK(implicit_euler_step(scene.input(), scene.start(), compliances, &x).iterations ==
          1);  // the guess is used
    // Forces balance: what is left of each is rounding of the forces that cancel.
    const double h = scene.settings.dt;
    const Objective o = step_objective(scene.input(), scene.start(), compliances, h);
    const auto g = gradient(o, x), at_start = gradient(o, o.predicted),
               at_rest = gradient(o, scene.model.positions);
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

  for (double wrong : {0.0, -1.0, std::nan("")})
    CHECK_THROWS_AS(implicit_euler_step(scene.input(), scene.start(), {1, wrong, 1}), Error);
  state.positions[4].x = std::nan("");
  CHECK_THROWS_AS(implicit_euler_step(scene.input(), state, {1, 1, 1}), Error);
}

// -------------------------------------------------------------------------------------------------------------
// statics

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
      for (std::size_t j = i; j < positions.size(); ++j)
        below += scene.model.masses[j] * scene.settings.gravity;
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

// ------------------------------------------------------------------------------------------------- PBD and
// comparisons

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
  scene.settings.ground = false;
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
  CHECK(error_to(scene.model, a, b) ==
        doctest::Approx(2 * std::sqrt(scene.model.masses[5] / mass) / scene.model.size));
  b.positions[5].y = std::nan("");
  CHECK(std::isnan(error_to(scene.model, a, b)));
  b.positions.pop_back();
  CHECK_THROWS_AS(error_to(scene.model, a, b), Error);
}
