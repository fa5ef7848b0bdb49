// One step of each mode against the same step in double on the CPU.
#include <doctest/doctest.h>

#include "tests/gl_test.h"
#include "tests/reference/reference_steps.h"
#include "tests/sim_samples.h"

using namespace samples;

TEST_CASE("one GPU step is the double CPU step, for each constraint kind, mode and size") {
  GlTest gl;
  for (const char* mode : {"node", "constraint"})
    for (const char* kinds : {"stretch", "bend", "volume", "stretch,bend,volume", "none"})
      for (glm::ivec3 cells : {glm::ivec3(1, 1, 1), glm::ivec3(4, 3, 2), glm::ivec3(8, 6, 4)}) {
        CAPTURE(mode);
        CAPTURE(kinds);
        CAPTURE(cells.x);
        Settings settings = quick(mode, 3, 2);
        settings.mass_splitting = cells.x == 4;
        settings.constraints = std::string(kinds) == "none" ? "" : kinds;
        Sim sim = create_sim(block_model(cells, -0.01, 1, "stretch:1.3"), settings);
        const State expected = reference_after(sim, 1, Sweep::jacobi);
        const State before = read_state(sim);
        step(sim);
        const State after = read_state(sim);
        CHECK(distance(after, expected) < 2e-6 * sim.model->size);
        double dv = 0;
        for (std::size_t i = 0; i < after.velocities.size(); ++i)
          dv = std::max(dv, glm::length(after.velocities[i] - expected.velocities[i]));
        CHECK(dv < 1e-3);
        if (std::string(kinds) != "none") CHECK(distance(after, before) > 1e-3);
      }
}

TEST_CASE("however kernels are cut into invocations, a step is the double CPU step") {
  GlTest gl;
  const auto model = block_model({8, 6, 4}, -0.01, 1, "stretch:1.3");
  const auto check = [&](const char* mode, const Tuning& tuning) {
    CAPTURE(mode);
    CAPTURE(tuning.group);
    CAPTURE(tuning.patch);
    CAPTURE(tuning.row);
    Sim sim = create_sim(model, quick(mode, 3, 2), tuning);
    const State expected = reference_after(sim, 1, Sweep::jacobi);
    step(sim);
    CHECK(distance(read_state(sim), expected) < 2e-6 * model->size);
    return state_hash(sim);
  };
  // Sums of whole numbers: the same bits however constraints are cut into patches, in rows of work-groups the
  // last of which is not full, and in both modes.
  const std::uint64_t bits = check("constraint", {});
  for (unsigned patch : {1, 17, 64, 100000}) CHECK(check("constraint", {.patch = patch}) == bits);
  CHECK(check("constraint", {.group = 32, .patch = 64, .row = 3}) == bits);
  for (unsigned patch : {0, 1, 7, 64}) CHECK(check("node", {.patch = patch}) == bits);
  CHECK(check("node", {.group = 256, .patch = 200}) == bits);
  CHECK(check("node", {.group = 32, .patch = 17, .row = 3}) == bits);
  check("paper", {});
  check("paper", {.row = 1});
}

TEST_CASE("a body is solved as well 1e4 sizes from the origin as near it") {
  GlTest gl;
  for (const char* mode : {"node", "constraint"}) {
    CAPTURE(mode);
    const auto model = block_model({4, 3, 2}, 0.3, 1, "stretch:1.2");
    auto far = std::make_shared<Model>(*model);
    const glm::dvec3 away(1e4, 2e4, -3e4);
    for (auto& p : far->positions) p += away;
    for (auto& p : far->rest.positions) p += away;
    Settings settings = quick(mode, 10, 2);
    settings.ground = false;
    Sim a = create_sim(model, settings), b = create_sim(far, settings);
    for (int s = 0; s < 20; ++s) step(a), step(b);
    State sa = read_state(a);
    for (auto& p : sa.positions) p += away;
    // Positions are rounded to places after every group, so more often.
    CHECK(distance(sa, read_state(b)) < 2e-6);
    CHECK(distance(sa, State{far->positions, {}}) > 0.01);
  }
}

TEST_CASE("the float Gauss-Seidel of mode cpu is the double one") {
  GlTest gl;
  Sim sim = create_sim(block_model({4, 3, 2}, 0.0, 1, "squash:0.8"), quick("cpu", 5, 2));
  const State expected = reference_after(sim, 1, Sweep::gauss_seidel);
  step(sim);
  CHECK(distance(read_state(sim), expected) < 1e-5);
}

TEST_CASE("node and constraint modes agree within 1e-4 of the body's size after 20 steps") {
  GlTest gl;
  Sim node = create_sim(block_model({8, 6, 4}, 0.02), quick("node"));
  Sim constraint = create_sim(node.model, quick("constraint"));
  for (int s = 0; s < 20; ++s) step(node), step(constraint);
  const State a = read_state(node), b = read_state(constraint);
  CHECK(distance(a, b) < 1e-4 * node.model->size);
  CHECK(distance(a, State{node.model->positions, {}}) > 0.01);
}

TEST_CASE("the float GPU solvers converge to the exact step as the double ones do") {
  GlTest gl;
  // A free body stretched by 5 %: the exact step is the rest shape, best placed.
  const auto model = block_model({5, 4, 3}, 0.2, 1, "stretch:1.05");
  double previous = 1;
  for (int iterations : {10, 100, 1000, 10000}) {
    double left[3];
    State states[3];
    for (int solver = 0; solver < 3; ++solver) {
      Settings settings = quick(solver == 2 ? "constraint" : "node", iterations);
      settings.gravity = 0;
      settings.ground = false;
      Sim sim = create_sim(model, settings);
      const State start = read_state(sim);
      const State exact = rigid_step({*model, sim.system, settings, sim.inverse_masses}, start);
      states[solver] = solver == 0 ? reference_after(sim, 1, Sweep::jacobi) : (step(sim), read_state(sim));
      left[solver] = error_to(*model, exact, states[solver]) / error_to(*model, exact, start);
    }
    const double node = error_to(*model, states[0], states[1]), constraint = error_to(*model, states[0], states[2]);
    MESSAGE(iterations << " iterations: left of the stretch: double " << left[0] << ", node " << left[1]
                       << ", constraint " << left[2] << "; distance to double over size: node " << node
                       << ", constraint " << constraint);
    CHECK(left[1] == doctest::Approx(left[0]).epsilon(0.01));
    CHECK(left[2] == doctest::Approx(left[0]).epsilon(0.01));
    CHECK(node < 2e-6);
    CHECK(constraint < 2e-6);
    CHECK(left[1] < previous);
    previous = left[1];
  }
}

TEST_CASE("a small body at rest beside one ten thousand times its size keeps as still as alone (long)") {
  GlTest gl;
  const auto model_with = [](bool big) {
    auto model = std::make_shared<Model>();
    const auto add = [&](const char* name, const glm::dvec3& size, const glm::ivec3& cells, const glm::dvec3& at,
                         bool fixed) {
      TetMesh mesh = make_block(size, cells);
      for (glm::dvec3& p : mesh.positions) p = rotation_of({20, 0, 30}) * p + at;
      std::vector<std::uint32_t> held;
      for (std::uint32_t v = 0; fixed && v < mesh.positions.size(); ++v) held.push_back(v);
      add_body(*model, name, mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), held);
    };
    add("small", {0.02, 0.02, 0.02}, {4, 4, 4}, {0, 0.5, 0}, false);
    if (big) add("big", {200, 1, 1}, {10, 1, 1}, {0, 10, 20}, true);
    return model;
  };
  for (const std::string mode : {"node", "constraint", "explicit", "newton", "vbd"}) {
    CAPTURE(mode);
    Settings settings;
    settings.mode = mode, settings.material = "neo-hookean", settings.young_modulus = 2e4;
    settings.poisson_ratio = 0.4, settings.gravity = 0, settings.ground = false;
    const auto fastest = [&](bool big) {
      Sim sim = create_sim(model_with(big), settings);
      CHECK(bool(sim.fineness) == big);
      for (int s = 0; s < 20; ++s) step(sim);
      const State state = read_state(sim);
      double most = 0;
      for (std::size_t v = 0; v < 125; ++v) most = std::max(most, glm::length(state.velocities[v]));
      return most;
    };
    const double alone = fastest(false), beside = fastest(true);
    CHECK(beside < 3 * alone + 1e-6);  // m/s
  }
}
