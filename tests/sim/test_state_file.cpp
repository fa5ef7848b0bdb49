// A state as a file: runs go on from it by the same bits, in every mode, and what is no such file is refused.
#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/scene.h"
#include "sim/error.h"
#include "sim/state_file.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"

using namespace tetpbd;
using namespace run_program;
namespace fs = std::filesystem;

namespace {

// Two blocks, one of which falls onto the other, beside an obstacle that moves.
Scene scene_of(const Folder& folder, const SolverMode& mode) {
  nlohmann::json scene = nlohmann::json::parse(R"({"bodies": [
    {"block": {"size": [0.4, 0.3, 0.4], "cells": [3, 2, 3]}, "position": [0, 0, 0]},
    {"block": {"size": [0.3, 0.3, 0.3], "cells": [2, 2, 2]}, "position": [0.05, 0.36, 0.02], "rotation": [10, 20, 0]}],
    "world": {"obstacles": [{"shape": "sphere", "radius": 0.1, "centre": [0.5, 0.1, 0], "velocity": [-0.5, 0, 0]}]}})");
  if (mode.forces)
    for (auto& body : scene["bodies"]) body["material"] = "foam";
  if (mode.published) scene["world"]["contact"] = "none";
  scene["solver"] = {{"mode", mode.name}};
  std::ofstream(folder.path / "m.json") << scene;
  return load_scene((folder.path / "m.json").string());
}

}  // namespace

TEST_CASE("states: a run goes on from its file by the same bits, in every mode (long)") {
  const GlTest gl;
  const Folder folder;
  for (const SolverMode& mode : solver_modes()) {
    CAPTURE(std::string(mode.name));
    const Scene scene = scene_of(folder, mode);
    const auto model = build_model(scene);
    Sim sim = create_sim(model, scene.settings);
    const auto run = [](Sim& one, int steps) {
      for (int s = 0; s < steps; ++s) step(one);
    };
    run(sim, 25);
    pin(sim, 3);
    run(sim, 2);
    const fs::path file = folder.path / "a.state";
    save_state(sim, file);
    run(sim, 30);
    Sim again = create_sim(model, scene.settings);
    CHECK(load_state(again, file));
    CHECK(again.steps == 27);
    CHECK(is_pinned(again, 3));
    run(again, 30);
    CHECK(simulated_time(again) == simulated_time(sim));
    CHECK(state_hash(again) == state_hash(sim));
    Settings other = scene.settings;
    other.friction = 0.1;
    Sim changed = create_sim(model, other);
    CHECK_FALSE(load_state(changed, file));
    CHECK(changed.steps == 27);
    run(changed, 2);
    CHECK_FALSE(check_finite(changed, true));
  }
}

TEST_CASE("states: what is none, is damaged or is of another model is refused, and nothing is lost") {
  const GlTest gl;
  const Folder folder;
  const Scene scene = scene_of(folder, *find_solver_mode("node"));
  const auto model = build_model(scene);
  Sim sim = create_sim(model, scene.settings);
  for (int s = 0; s < 5; ++s) step(sim);
  const fs::path file = folder.path / "a.state", broken = folder.path / "b.state";
  save_state(sim, file);
  const std::string whole = read(file);
  const std::uint64_t before = state_hash(sim);
  const auto refused = [&](const std::string& bytes, const std::string& message) {
    std::ofstream(broken, std::ios::binary) << bytes;
    CHECK_THROWS_WITH(load_state(sim, broken), doctest::Contains(message.c_str()));
    CHECK(state_hash(sim) == before);
  };
  refused("", "this is no state");
  refused("{\"state_hash\": 3}", "this is no state");
  refused(whole.substr(0, 200), "damaged");
  refused(whole.substr(0, whole.size() - 1), "damaged");
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 1;
  refused(flipped, "damaged");
  std::string newer = whole;
  newer[13] = '9';
  refused(newer, "another version");
  CHECK_THROWS_WITH(load_state(sim, folder.path / "none.state"), doctest::Contains("no such state"));
  Scene finer = scene;
  finer.bodies[0].block->cells = {4, 2, 3};
  Sim of_another = create_sim(build_model(finer), scene.settings);
  CHECK_THROWS_WITH(load_state(of_another, file), doctest::Contains("another model"));
}

TEST_CASE("states: the command line saves one and goes on from it") {
  const Folder folder;
  std::ofstream(folder.path / "m.json") << R"({"bodies": [{"block": {"cells": [2, 2, 2]}, "position": [0, 0.2, 0]}]})";
  const auto run = [&](const std::string& more) {
    const Outcome done = program("run --scene m.json --mode cpu --out r " + more, folder);
    CHECK_MESSAGE(done.status == 0, done.err);
    return nlohmann::json::parse(read(folder.path / "r/stats.json"));
  };
  const auto whole = run("--steps 40");
  run("--steps 25 --save-state half.state");
  const auto rest = run("--steps 15 --from-state half.state");
  CHECK(rest["state_hash"] == whole["state_hash"]);
  CHECK(rest["timing"]["steps"] == 40);
  const Outcome other =
      program("run --scene m.json --mode cpu --friction 0.1 --steps 1 --out r --from-state half.state", folder);
  CHECK(other.err.find("positions and velocities alone") != std::string::npos);
  const Outcome none = program("run --scene m.json --steps 1 --out r --from-state m.json", folder);
  CHECK(none.status == 2);
  CHECK(none.err.find("this is no state") != std::string::npos);
}
