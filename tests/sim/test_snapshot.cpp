// A snapshot is all that a step hands on to the next: whoever goes back to one takes the same steps again.
#include <doctest/doctest.h>

#include <algorithm>

#include "sim/model/material.h"
#include "sim/snapshot.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"

using namespace tetpbd;

namespace {

// Falls to the ground, bounces and slides.
std::shared_ptr<const Model> thrown_block() {
  TetMesh mesh = make_block(glm::dvec3(1, 0.6, 0.5), {5, 3, 2});
  for (auto& p : mesh.positions) p.y += 0.2;
  auto model = std::make_shared<Model>();
  add_body(*model, "block", mesh, 1000, mesh.positions, {1, -3, 0}, {0, 0, 2}, {});
  return model;
}

struct Kept {
  Buffer buffer;
  Snapshot snapshot;
};
Kept keep(Sim& sim) {
  Buffer buffer("kept", snapshot_bytes(sim));
  Snapshot snapshot = take_snapshot(sim, buffer, 0);
  return {std::move(buffer), std::move(snapshot)};
}

}  // namespace

TEST_CASE("snapshot: from one on, every mode takes the same steps again, bit by bit") {
  GlTest gl;
  for (const SolverMode& mode : solver_modes())
    for (const char* made : {"of its mode", "linear", "smoothed"}) {
      if (made == std::string("smoothed") && !mode.smoothed) continue;
      const bool soft = made != std::string("of its mode");
      Settings settings;
      settings.iterations = 2, settings.substeps = 3;
      settings.mode = mode.name;
      if (soft) settings.element = made;
      if (soft || mode.forces) apply_preset(settings, material_presets(), "rubber");
      if (soft) settings.constraint_damping = 1e-3;
      CAPTURE(mode.name);
      CAPTURE(made);
      Sim sim = create_sim(thrown_block(), settings);
      std::vector<Kept> kept;
      std::vector<std::uint64_t> hashes;
      for (int s = 0; s < 70; ++s) {
        kept.push_back(keep(sim));
        hashes.push_back(state_hash(sim));
        step(sim);
      }
      for (const std::size_t back :
           is_long_run() ? std::vector<std::size_t>{13, 66, 0, 31} : std::vector<std::size_t>{66, 31}) {
        restore_snapshot(sim, kept[back].snapshot, kept[back].buffer);
        CHECK(state_hash(sim) == hashes[back]);
        for (std::size_t s = back + 1; s < hashes.size(); ++s) step(sim);
        CHECK(sim.steps == long(hashes.size()) - 1);
        CHECK(state_hash(sim) == hashes.back());
      }
    }
}

TEST_CASE("snapshot: with other settings the state goes on with those") {
  GlTest gl;
  Settings settings;
  settings.substeps = 3;
  Sim sim = create_sim(thrown_block(), settings);
  for (int s = 0; s < 20; ++s) step(sim);
  const Kept kept = keep(sim);
  const State then = read_state(sim);
  for (const std::string words :
       {"mode=cpu-double", "mode=constraint", "substeps=1", "gravity=0", "mode=node", "dt=0.01"}) {
    CAPTURE(words);
    Settings other = sim.settings;
    const std::size_t equals = words.find('=');
    set_parameter(other, *find_parameter(words.substr(0, equals)), words.substr(equals + 1), "test");
    apply_settings(sim, other);
    step(sim);
    const Kept again = keep(sim);  // also of the other mode
    for (const Kept* of : {&kept, &again, &kept}) restore_snapshot(sim, of->snapshot, of->buffer);
    CHECK(simulated_time(sim) == doctest::Approx(20 * settings.dt));
    const State now = read_state(sim);
    const double h = 0.5 * other.dt / other.substeps * other.gravity;  // mid-substep
    const double upwards = h - 0.5 * plan_for(settings).h * settings.gravity;
    for (std::size_t i = 0; i < now.positions.size(); ++i) {
      CHECK(glm::distance(now.positions[i], then.positions[i]) < 1e-12);
      CHECK(glm::distance(now.velocities[i], then.velocities[i] + glm::dvec3(0, upwards, 0)) < 1e-12);
    }
    step(sim);
    CHECK(!check_finite(sim, true));
    CHECK(sim.steps == 21);
  }
}

TEST_CASE("snapshot: mode newton goes back into shorter substeps, and out of them (long)") {
  GlTest gl;
  Settings settings;
  settings.iterations = 4, settings.substeps = 1;
  settings.mode = "newton", settings.material = "neo-hookean";
  settings.young_modulus = 1e8, settings.poisson_ratio = 0.495;
  Sim sim = create_sim(thrown_block(), settings);
  std::vector<Kept> kept;
  std::vector<std::uint64_t> hashes;
  std::vector<int> finer;
  for (int s = 0; s < 60; ++s) {
    kept.push_back(keep(sim)), hashes.push_back(state_hash(sim)), finer.push_back(sim.adaptive.substep_factor);
    step(sim);
  }
  CHECK(finer.front() == 1);
  const auto first = std::size_t(std::ranges::find(finer, 4) - finer.begin());
  REQUIRE(first < finer.size());
  for (const std::size_t back : {first, std::size_t(0), first + 3, first - 1}) {
    CAPTURE(back);
    restore_snapshot(sim, kept[back].snapshot, kept[back].buffer);
    CHECK(sim.adaptive.substep_factor == finer[back]);
    for (std::size_t s = back + 1; s < hashes.size(); ++s) step(sim);
    CHECK(state_hash(sim) == hashes.back());
  }
}

TEST_CASE("snapshot: bodies that touch take the same steps again, before, in and after contact (long)") {
  GlTest gl;
  for (const SolverMode& mode : solver_modes()) {
    if (!mode.pairs) continue;
    const bool cloth = !mode.forces;  // on itself and on a block
    CAPTURE(mode.name);
    auto model = std::make_shared<Model>();
    const TetMesh block = make_block(glm::dvec3(0.5), glm::ivec3(is_long_run() ? 3 : 2));
    for (const double side : {-1.0, 1.0}) {
      auto start = block.positions;
      for (auto& p : start) p += glm::dvec3(side * 0.3, side * 0.03, 0);
      add_body(*model, "block", block, 1000, start, {-3 * side, 0, 0}, glm::dvec3(0), {});
    }
    if (cloth) {
      const int cells = is_long_run() ? 8 : 5;
      const TetMesh sheet = make_sheet({0.8, 0.8}, {cells, cells});
      auto start = sheet.positions;
      for (auto& p : start) p += glm::dvec3(0, 0.32, 0);
      add_body(*model, "sheet", sheet, 300, start, {0, -3, 0}, glm::dvec3(0), {});
    }
    Settings settings;
    settings.iterations = 4, settings.substeps = 6;
    settings.mode = mode.name, settings.contact = cloth ? "self" : "bodies", settings.gravity = 0,
    settings.ground = false;
    apply_preset(settings, material_presets(), "rubber");
    if (cloth) settings.material = "none", settings.compliance = {};
    Sim sim = create_sim(model, settings);
    std::vector<Kept> kept;
    std::vector<std::uint64_t> hashes;
    for (int s = 0; s < (is_long_run() ? 40 : 26); ++s) {
      kept.push_back(keep(sim)), hashes.push_back(state_hash(sim));
      step(sim);
    }
    if (!on_cpu(sim)) CHECK(touched(sim).touches > 0);
    for (const std::size_t back :
         is_long_run() ? std::vector<std::size_t>{7, 3, 11, 30, 0, 15} : std::vector<std::size_t>{11, 3, 20}) {
      CAPTURE(back);
      restore_snapshot(sim, kept[back].snapshot, kept[back].buffer);
      for (std::size_t s = back + 1; s < hashes.size(); ++s) {
        step(sim);
        if (s % 6 == 0) CHECK(state_hash(sim) == hashes[s]);
      }
      CHECK(state_hash(sim) == hashes.back());
    }
  }
}

TEST_CASE("snapshot: back in time in another mode, in contact, is the same as starting there from that state (long)") {
  GlTest gl;
  auto model = std::make_shared<Model>();
  const TetMesh block = make_block(glm::dvec3(0.5), {2, 2, 2});
  for (const double side : {-1.0, 1.0}) {
    auto start = block.positions;
    for (auto& p : start) p += glm::dvec3(side * 0.27, 0.25 + side * 0.03, 0);
    add_body(*model, "block", block, 1000, start, {-3 * side, -1, 0}, {0, 0, 2 * side}, {});
  }
  const auto in_mode = [](const char* mode, bool touching) {
    Settings settings;
    settings.iterations = 1, settings.substeps = 3;  // odd: a double-buffered solver ends on its other side
    settings.mode = mode, settings.contact = touching ? "bodies" : "none";
    if (touching) apply_preset(settings, material_presets(), "rubber");
    return settings;
  };
  for (const bool touching : {true, false})  // without a material: hard bodies, moved as rigid ones on the ground
    for (const char* first : {"node", "constraint", "cpu", "explicit", "newton", "vbd"}) {
      const bool forces = find_solver_mode(first)->forces;
      if (forces && !touching) continue;
      Sim before = create_sim(model, in_mode(first, touching));
      for (int s = 0; s < 27; ++s) step(before);
      const Kept kept = keep(before);
      for (const char* second : {"node", "constraint", "cpu-double", "explicit", "newton", "vbd"}) {
        const bool other_forces = find_solver_mode(second)->forces;
        if (std::string(second) == first || (other_forces && !touching)) continue;
        CAPTURE(touching);
        CAPTURE(first);
        CAPTURE(second);
        Sim sim = create_sim(model, in_mode(first, touching));
        for (int s = 0; s < 31; ++s) step(sim);
        apply_settings(sim, in_mode(second, touching));
        for (int s = 0; s < 3; ++s) step(sim);
        restore_snapshot(sim, kept.snapshot, kept.buffer);
        Sim fresh = create_sim(model, in_mode(second, touching));
        restore_snapshot(fresh, kept.snapshot, kept.buffer);
        CHECK(sim.steps == 27);
        for (int s = 0; s < 3; ++s) step(sim), step(fresh);
        CHECK(!check_finite(sim, true));
        CHECK(state_hash(sim) == state_hash(fresh));
      }
    }
}
