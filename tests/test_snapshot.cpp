// A snapshot is all that a step hands on to the next: whoever goes back to one takes the same steps again.
#include <doctest/doctest.h>

#include "sim/material.h"
#include "sim/snapshot.h"
#include "tests/gl_test.h"

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
Kept keep(const Sim& sim) {
  Buffer buffer("kept", snapshot_bytes(sim));
  Snapshot snapshot = take_snapshot(sim, buffer, 0);
  return {std::move(buffer), std::move(snapshot)};
}

}  // namespace

TEST_CASE("snapshot: from one on, every mode takes the same steps again, bit by bit") {
  GlTest gl;
  for (const SolverMode& mode : solver_modes())
    for (const bool soft : {false, true}) {
      Settings settings{.iterations = 2, .substeps = 3};
      settings.mode = mode.name;
      if (soft || mode.leapfrog || mode.implicit) apply_preset(settings, material_presets(), "rubber");
      if (soft) settings.constraint_damping = 1e-3;
      CAPTURE(mode.name);
      CAPTURE(soft);
      Sim sim = create_sim(thrown_block(), settings);
      std::vector<Kept> kept;
      std::vector<std::uint64_t> hashes;
      for (int s = 0; s < 70; ++s) {
        kept.push_back(keep(sim));
        hashes.push_back(state_hash(sim));
        step(sim);
      }
      for (const std::size_t back : {13, 66, 0, 31}) {
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
       {"mode=cpu-double", "mode=constraint", "substeps=1", "gravity=0", "mode=node"}) {
    CAPTURE(words);
    Settings other = sim.settings;
    const std::size_t equals = words.find('=');
    set_parameter(other, *find_parameter(words.substr(0, equals)), words.substr(equals + 1), "test");
    apply_settings(sim, other);
    step(sim);
    const Kept again = keep(sim);  // also of the other mode
    for (const Kept* of : {&kept, &again, &kept}) restore_snapshot(sim, of->snapshot, of->buffer);
    const State now = read_state(sim);
    const double h = 0.5 * other.dt / other.substeps * other.gravity;  // mid-substep
    const double upwards = h - 0.5 * settings.dt / settings.substeps * settings.gravity;
    for (std::size_t i = 0; i < now.positions.size(); ++i) {
      CHECK(glm::distance(now.positions[i], then.positions[i]) < 1e-12);
      CHECK(glm::distance(now.velocities[i], then.velocities[i] + glm::dvec3(0, upwards, 0)) < 1e-12);
    }
    step(sim);
    CHECK(!check_finite(sim, true));
    CHECK(sim.steps == 21);
  }
}
