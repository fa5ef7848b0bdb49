// The laws that a run has to keep, in every mode.
#include <doctest/doctest.h>

#include "app/lab/run.h"
#include "sim/measure/metrics.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"
#include "tests/sim_samples.h"

using namespace samples;

TEST_CASE("free fall is half g t^2 to 1e-5, for any number of substeps") {
  GlTest gl;
  for (const char* mode : {"node", "constraint", "cpu", "cpu-fast"})
    for (int substeps : {1, 10, 100, 1000}) {
      CAPTURE(mode);
      CAPTURE(substeps);
      Settings settings = quick(mode, 1, substeps);
      settings.ground = false;
      Sim sim = create_sim(block_model({3, 2, 2}), settings);
      const int steps = substeps == 1000 ? 6 : 60;
      for (int s = 0; s < steps; ++s) step(sim);
      const double t = steps * settings.dt, fall = 0.5 * settings.gravity * t * t;
      const State state = read_state(sim);
      double worst = 0;
      for (std::size_t i = 0; i < state.positions.size(); ++i)
        worst = std::max(worst, glm::length(state.positions[i] - (sim.model->positions[i] - glm::dvec3(0, fall, 0))));
      CHECK(worst < 1e-5 * fall);
    }
}

TEST_CASE("what rests stays at rest") {
  GlTest gl;
  int number = 0;
  for (const SolverMode& mode : pbd_modes()) {
    ++number;  // the short suite takes the modes by turns in one substep and in five
    for (int substeps : {1, 5}) {
      if (!is_long_run() && (number % 2 == 0) == (substeps == 1)) continue;
      CAPTURE(mode.name);
      CAPTURE(substeps);
      Settings floating = quick(mode.name, 5, substeps);
      floating.gravity = 0;
      floating.ground = false;
      Sim sim = create_sim(block_model({4, 3, 2}), floating);
      for (int s = 0; s < 50; ++s) step(sim);
      CHECK(distance(read_state(sim), State{sim.model->positions, {}}) < 1e-6);
      // A hard block that stands stays to the last bit; where corrections become velocity it sags and creeps.
      TetMesh mesh = make_block(glm::dvec3(1.0, 0.5, 0.5), {4, 2, 2});
      for (auto& p : mesh.positions) p.y += 0.25;
      auto model = std::make_shared<Model>();
      add_body(*model, "block", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
      for (const bool rigid : {true, false}) {
        CAPTURE(rigid);
        Settings settings = quick(mode.name, 20, substeps);
        settings.rigid_contact = rigid;
        Sim standing = create_sim(model, settings);
        for (int s = 0; s < 200; ++s) step(standing);
        const State settled = read_state(standing);
        for (int s = 0; s < 100; ++s) step(standing);
        CHECK(distance(read_state(standing), settled) < (rigid ? 1e-8 : 2e-3));
        CHECK(distance(settled, State{mesh.positions, {}}) < (rigid ? 1e-5 : 0.02));
      }
    }
  }
}

TEST_CASE("a run moved and turned about the vertical is the same run, moved and turned") {
  GlTest gl;
  for (const SolverMode& mode : pbd_modes()) {
    CAPTURE(mode.name);
    const auto model = block_model({4, 3, 2}, 0.05);
    auto moved = std::make_shared<Model>(*model);
    const auto turn = [](glm::dvec3 p) {
      return glm::dvec3(0.6 * p.x + 0.8 * p.z, p.y, -0.8 * p.x + 0.6 * p.z) + glm::dvec3(5, 0, -3);
    };
    for (auto* list : {&moved->positions, &moved->rest.positions})
      for (auto& p : *list) p = turn(p);
    Sim a = create_sim(model, quick(mode.name, 10)), b = create_sim(moved, quick(mode.name, 10));
    for (int s = 0; s < 30; ++s) step(a), step(b);
    State sa = read_state(a);
    for (auto& p : sa.positions) p = turn(p);
    CHECK(distance(sa, read_state(b)) < 1e-4);
  }
}

TEST_CASE("friction stops a sliding block and none does not") {
  GlTest gl;
  TetMesh mesh = make_block(glm::dvec3(1.0, 0.5, 0.5), {2, 1, 1});
  for (auto& p : mesh.positions) p.y += 0.25;
  for (const SolverMode& mode : pbd_modes())
    for (const double friction : {0.0, 0.5}) {
      CAPTURE(mode.name);
      CAPTURE(friction);
      auto model = std::make_shared<Model>();
      add_body(*model, "block", mesh, 1000, mesh.positions, glm::dvec3(1, 0, 0), glm::dvec3(0), {});
      Settings settings = quick(mode.name, 10, 4);
      settings.friction = friction;
      Sim sim = create_sim(model, settings);
      for (int s = 0; s < 100; ++s) step(sim);
      const State state = read_state(sim);
      double travelled = 0;
      for (std::size_t i = 0; i < mesh.positions.size(); ++i)
        travelled += (state.positions[i].x - mesh.positions[i].x) / double(mesh.positions.size());
      // Coulomb: v^2 / (2 mu g) = 0.102 m with friction 0.5; 0.5 m in 0.5 s without.
      CHECK(travelled / (friction == 0 ? 0.5 : 1 / 9.81) == doctest::Approx(1).epsilon(0.01));
    }
}

TEST_CASE("a hard body hung by a corner swings as a rigid one, and gains no energy (long)") {
  GlTest gl;
  const auto model = std::make_shared<Model>(*block_model({4, 3, 2}));
  const std::uint32_t pivot = 0;
  model->inverse_masses[pivot] = 0;
  const glm::dvec3 hook = model->positions[pivot];
  // Euler's equations about the hook by Runge-Kutta: d/dt L = r x M g, d/dt R = w x R.
  struct Motion {
    glm::dmat3 R;
    glm::dvec3 L;
  };
  glm::dvec3 moment(0);
  glm::dmat3 inertia(0);
  for (std::size_t i = 0; i < model->masses.size(); ++i) {
    const glm::dvec3 r = model->positions[i] - hook;
    moment += model->masses[i] * r;
    inertia += model->masses[i] * (glm::dmat3(glm::dot(r, r)) - glm::outerProduct(r, r));
  }
  const auto rate = [&](const Motion& m) {
    const glm::dvec3 w = m.R * (glm::inverse(inertia) * (glm::transpose(m.R) * m.L));
    return Motion{glm::dmat3(glm::cross(w, m.R[0]), glm::cross(w, m.R[1]), glm::cross(w, m.R[2])),
                  glm::cross(m.R * moment, glm::dvec3(0, -9.81, 0))};
  };
  const auto moved = [](const Motion& m, double h, const Motion& by) { return Motion{m.R + h * by.R, m.L + h * by.L}; };
  Motion right{glm::dmat3(1), glm::dvec3(0)};
  const double h = 1e-4;
  for (int s = 0; s < 10000; ++s) {
    const Motion a = rate(right), b = rate(moved(right, h / 2, a)), c = rate(moved(right, h / 2, b)),
                 d = rate(moved(right, h, c));
    right = moved(moved(moved(moved(right, h / 6, a), h / 3, b), h / 3, c), h / 6, d);
  }
  for (const SolverMode& mode : pbd_modes()) {
    CAPTURE(mode.name);
    Settings settings = quick(mode.name, 1, 50);
    settings.ground = false;
    settings.mass_splitting = true;  // averaging gains 5 % of energy, with any number of substeps
    Sim sim = create_sim(model, settings);
    const auto energy = [&] {
      const State state = read_state(sim);
      double sum = 0;
      for (std::size_t i = 0; i < state.positions.size(); ++i)
        sum += model->masses[i] *
               (glm::dot(state.velocities[i], state.velocities[i]) / 2 + 9.81 * (state.positions[i].y - hook.y));
      return sum;
    };
    const double start = energy();
    double most = start;
    for (int s = 0; s < 200; ++s) step(sim), most = std::max(most, energy());
    const State state = read_state(sim);
    double squares = 0, mass = 0;
    for (std::size_t i = 0; i < state.positions.size(); ++i) {
      const glm::dvec3 r = model->positions[i] - hook, apart = state.positions[i] - hook - right.R * r;
      squares += model->masses[i] * glm::dot(apart, apart), mass += model->masses[i];
    }
    CHECK(glm::length(state.positions[pivot] - hook) < 1e-6);
    CHECK(std::sqrt(squares / mass) < 0.003 * model->size);
    CHECK(most - start < 1e-5 * std::abs(start));
  }
}

TEST_CASE("mass splitting keeps momentum") {
  GlTest gl;
  for (const char* mode : {"node", "constraint"}) {
    CAPTURE(mode);
    Settings settings = quick(mode);
    settings.gravity = 0;
    settings.ground = false;
    settings.mass_splitting = true;
    Sim sim = create_sim(block_model({5, 4, 3}, 1, 1, "random"), settings);
    const auto centre = [&] {
      glm::dvec3 sum(0);
      double mass = 0;
      const State state = read_state(sim);
      for (std::size_t i = 0; i < state.positions.size(); ++i)
        sum += sim.model->masses[i] * state.positions[i], mass += sim.model->masses[i];
      return sum / mass;
    };
    const glm::dvec3 before = centre();
    for (int s = 0; s < 400; ++s) step(sim);
    CHECK(glm::length(centre() - before) < 1e-5 * sim.model->size);  // averaging: 1e-2
  }
}

TEST_CASE("iterations and the volume constraint lower the volume lost in a fall") {
  GlTest gl;
  const auto model = block_model({8, 6, 4}, 0.1);
  const auto loss = [&](const std::string& kinds, int iterations) {
    Settings settings = quick("node", iterations);
    settings.constraints = kinds, settings.rigid_contact = false;
    Sim sim = create_sim(model, settings);
    Metrics metrics = create_metrics(*model);
    const RunErrors errors = run_to_end(sim, &metrics, 60).errors;
    CHECK(errors.finite);
    return errors.max_volume_loss_percent;
  };
  double previous = 100;
  for (int iterations : {5, 10, 15, 20, 25}) {
    const double now = loss("stretch,bend,volume", iterations);
    CHECK(now < previous);
    previous = now;
  }
  CHECK(loss("stretch,bend", 10) > loss("stretch,bend,volume", 10));
}
