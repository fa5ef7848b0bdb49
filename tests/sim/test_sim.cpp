// A simulation as its callers use it: pins, settings that change, what is allocated, its bits.
#include <doctest/doctest.h>

#include "sim/error.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace samples;

TEST_CASE("the same run gives the same bits") {
  GlTest gl;
  const auto model = block_model({8, 6, 4}, 0.01);
  for (const SolverMode& mode : pbd_modes()) {
    CAPTURE(mode.name);
    std::uint64_t hashes[2];
    for (auto& hash : hashes) {
      Sim sim = create_sim(model, quick(mode.name, 5, 2));
      for (int s = 0; s < 15; ++s) step(sim);
      hash = state_hash(sim);
    }
    CHECK(hashes[0] == hashes[1]);
    Settings settings = quick(mode.name, 6, 2);
    settings.rigid_contact = false;
    Sim other = create_sim(model, settings);
    for (int s = 0; s < 15; ++s) step(other);
    CHECK(state_hash(other) != hashes[0]);
  }
}

TEST_CASE("positions and velocities keep 48 bits on their way to the GPU and back, whatever their number") {
  GlTest gl;
  for (int cells : {1, 2, 3, 4, 5, 6, 7}) {
    auto model = std::make_shared<Model>(*block_model({cells, 1, 1}));
    for (std::size_t i = 0; i < model->velocities.size(); ++i)
      model->velocities[i] = {std::sqrt(2.0 + double(i)), -std::sqrt(3.0 + double(i)), std::sqrt(5.0 + double(i))};
    Settings settings = quick("node");
    settings.gravity = 0;  // no half-step start: velocities as given
    const Sim sim = create_sim(model, settings);
    const State state = read_state(sim);
    for (std::size_t i = 0; i < state.positions.size(); ++i) {
      CHECK(glm::length(state.positions[i] - model->positions[i]) < 1e-14);
      CHECK(glm::length(state.velocities[i] - model->velocities[i]) < 1e-13);
    }
  }
}

TEST_CASE("vertices in another order are the same bodies, and what leaves is in the first order") {
  GlTest gl;
  const auto plain = block_model({4, 3, 2}, 0.05);
  auto two = std::make_shared<Model>();
  for (int b = 0; b < 2; ++b) {
    auto start = plain->rest.positions;
    for (auto& p : start) p.x += 3.0 * b;
    add_body(*two, "block", plain->rest, 1000, start, glm::dvec3(b, 0, 0), glm::dvec3(0, 1, 0), {2});
  }
  auto turned = std::make_shared<Model>(*two);
  renumber(*turned);
  CHECK(turned->original != two->original);
  CHECK(original_tets(*turned) == two->rest.tets);
  CHECK(in_original_order(*turned, turned->rest.positions) == two->rest.positions);
  CHECK(in_original_order(*turned, turned->masses) == two->masses);
  for (std::size_t t = 0; t < two->rest.tets.size(); ++t)
    CHECK(tet_volume(turned->rest, turned->rest.tets[t]) == tet_volume(two->rest, two->rest.tets[t]));
  for (const Body& body : turned->bodies)
    for (std::size_t i = 0; i < body.vertices; ++i)
      CHECK(turned->original[body.first_vertex + i] / body.vertices == body.first_vertex / body.vertices);
  for (const char* mode : {"node", "constraint"}) {
    Sim a = create_sim(two, quick(mode)), b = create_sim(turned, quick(mode));
    for (int s = 0; s < 10; ++s) step(a), step(b);
    State sorted = read_state(b);
    sorted.positions = in_original_order(*turned, sorted.positions);
    CHECK(distance(read_state(a), sorted) < 1e-5);
  }
}

TEST_CASE("fixed and pinned vertices stay, moved ones pull, unpinned ones fall") {
  GlTest gl;
  for (const SolverMode& mode : pbd_modes()) {
    CAPTURE(mode.name);
    Sim sim = create_sim(block_model({4, 3, 2}, 0.5), quick(mode.name));
    pin(sim, 7);
    CHECK(is_pinned(sim, 7));
    const glm::dvec3 before = read_state(sim).positions[7];
    for (int s = 0; s < 10; ++s) step(sim);
    CHECK(glm::length(read_state(sim).positions[7] - before) < 1e-6);
    const glm::dvec3 target = before + glm::dvec3(0.1, 0.2, 0);
    move_pinned(sim, 7, target);
    for (int s = 0; s < 3; ++s) step(sim);
    CHECK(glm::length(read_state(sim).positions[7] - target) < 1e-6);
    unpin(sim, 7);
    CHECK(!is_pinned(sim, 7));
    for (int s = 0; s < 20; ++s) step(sim);
    CHECK(glm::length(read_state(sim).positions[7] - target) > 0.01);
    reset(sim);
    CHECK(distance(read_state(sim), State{sim.model->positions, {}}) < 1e-6);
  }
}

TEST_CASE("settings change while running: mode, kinds and numbers, and the state stays") {
  GlTest gl;
  Sim sim = create_sim(block_model({4, 3, 2}, 0.1), quick("node"));
  for (const char* mode : {"constraint", "cpu", "node", "cpu", "constraint"})
    for (const char* kinds : {"stretch", "stretch,bend,volume", "", "volume,stretch"}) {
      for (int s = 0; s < 3; ++s) step(sim);
      const State before = read_state(sim);
      Settings settings = sim.settings;
      settings.mode = mode;
      settings.constraints = kinds;
      settings.omega = 1.2;
      apply_settings(sim, settings);
      CHECK(distance(read_state(sim), before) < 1e-12);
      step(sim);
      CHECK(distance(read_state(sim), before) > 0);
    }
  Settings wrong = sim.settings;
  wrong.mode = "none of these";
  CHECK_THROWS(apply_settings(sim, wrong));
  step(sim);
}

TEST_CASE("one iteration a substep: changes from outside between steps take effect at once") {
  GlTest gl;
  // The places of a step are made by the step before it; these invalidate them.
  for (const char* mode : {"node", "constraint", "paper"}) {
    CAPTURE(mode);
    Settings constraints_alone = quick(mode, 1, 3);
    constraints_alone.rigid_contact = false;
    Sim sim = create_sim(block_model({4, 3, 2}, 0.05, 1, "stretch:1.1"), constraints_alone);
    CpuPbd<double> pbd(*sim.model, sim.system);
    State expected = read_state(sim);
    const auto check = [&] {
      step(sim);
      pbd.step(expected, sim.settings, sim.inverse_masses, Sweep::jacobi);
      CHECK(distance(read_state(sim), expected) < 5e-6);
    };
    check();
    check();
    pin(sim, 5);
    expected.velocities[5] = glm::dvec3(0);
    check();
    const glm::dvec3 way(0.05, 0.02, 0);
    move_pinned(sim, 5, expected.positions[5] + way);
    expected.velocities[5] = way / sim.settings.dt;
    check();
    expected.velocities[5] = glm::dvec3(0);
    unpin(sim, 5);
    check();
    Settings settings = sim.settings;
    settings.gravity = -20;
    settings.substeps = 2;
    settings.damping = 3;
    apply_settings(sim, settings);
    expected.velocities = read_state(sim).velocities;  // now those of another half substep
    check();
    settings.iterations = 4;
    apply_settings(sim, settings);
    check();
    settings.iterations = 0;
    apply_settings(sim, settings);
    check();
    settings.iterations = 1;
    apply_settings(sim, settings);
    check();
    for (auto& v : expected.velocities) v.x += 1;
    write_state(sim, expected);
    check();
  }
}

TEST_CASE("tuning is checked, and so is the size of a storage buffer") {
  GlTest gl;
  const auto model = block_model({4, 3, 2});
  CHECK_THROWS_AS(create_sim(model, quick("node"), {.group = 96}), Error);
  CHECK_THROWS_AS(create_sim(model, quick("node"), {.group = 32, .patch = 33}), Error);
  for (const char* mode : {"node", "constraint", "paper"}) {
    CAPTURE(mode);
    std::string message;
    try {
      create_sim(model, quick(mode), {.storage = 3000});
    } catch (const Error& error) {
      message = error.what();
    }
    CHECK(message.find("too large") != std::string::npos);
    CHECK(message.find("3000") != std::string::npos);
  }
}

TEST_CASE("only what a scene needs is allocated and dispatched") {
  GlTest gl;
  const auto model = block_model({4, 3, 2});
  const auto has = [](const Explanation& e, const std::string& word) {
    for (const auto& b : e.buffers)
      if (b.name.find(word) != std::string::npos) return true;
    for (const auto& d : e.dispatches)
      if (d.name.find(word) != std::string::npos) return true;
    return false;
  };
  Settings settings = quick("constraint");
  const auto cost = [&] {
    Sim sim = create_sim(model, settings);
    return explain(sim);
  };
  Explanation all = cost();
  CHECK(has(all, "bend"));
  CHECK(has(all, "volume"));
  settings.constraints = "stretch";
  const Explanation some = cost();
  CHECK(!has(some, "bend"));
  CHECK(!has(some, "volume"));
  CHECK(some.bytes < all.bytes);
  CHECK(some.dispatches_per_step == 1 + 10 * 2);
  CHECK(all.dispatches_per_step == 1 + 10 * 2);
  CHECK(has(all, "rigid_contact"));
  settings.rigid_contact = false;
  all = cost();
  CHECK(all.dispatches_per_step == 10 * 2);
  CHECK(!has(all, "rigid_contact"));
  CHECK(!has(all, "hard bodies"));
  settings.mode = "node";
  CHECK(cost().dispatches_per_step == 10);
  settings.constraints = "stretch,bend,volume";
  settings.mode = "paper";
  settings.constraints = "stretch,bend,volume";
  CHECK(cost().dispatches_per_step == 1 + 10 * 4 + 1);
}
