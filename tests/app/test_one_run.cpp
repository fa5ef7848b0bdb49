// One scene with one setting comes to one state, whoever steps it.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "app/commands.h"
#include "app/lab/baselines.h"
#include "app/lab/live_map.h"
#include "app/window/record.h"
#include "app/window/session.h"
#include "sim/interrupt.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"

using namespace tetpbd;
using nlohmann::json;
using run_program::Folder, run_program::program, run_program::read;

namespace {

constexpr long steps = 8;
const SceneOverrides small{.parameters = {{"mode", "node"}, {"iterations", "1"}, {"substeps", "5"}},
                           .set = {"bodies.0.block.cells=[3,2,2]"}};
const std::string words = " --scene beam --set bodies.0.block.cells=[3,2,2] --mode node --iterations 1 --substeps 5 ";

std::string text(std::uint64_t hash) { return fmt::format("{:016x}", hash); }

}  // namespace

TEST_CASE("one run: run, compare, map, the live map, a lane and a replayed record end in one state") {
  const Folder folder;
  const auto rows = [&](const std::string& command, const std::string& name) {
    const auto outcome = program(command, folder);
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    const json rows = json::parse(read(folder.path / (name + ".json")))["rows"];
    CHECK(read(folder.path / (name + ".csv")).find(rows[0]["state_hash"].get<std::string>()) != std::string::npos);
    return rows;
  };
  const std::string length = fmt::format("--steps {} ", steps);
  REQUIRE(program("run" + words + length + "--out run", folder).status == 0);
  const std::string expected = json::parse(read(folder.path / "run/stats.json"))["state_hash"];
  CHECK(rows("compare" + words + length + "--judge volume --out c", "c/compare")[0]["state_hash"] == expected);
  CHECK(rows("map" + words + length + "--x substeps=5,2 --y iterations=1 --out m", "m/map")[0]["state_hash"] ==
        expected);

  RunOptions options;
  options.out = folder.path / "again", options.size = {64, 48}, options.samples = 0;
  options.replay = folder.path / "record.jsonl";
  {
    GlTest gl;
    Session s;
    s.playing = false;
    s.record = std::make_unique<Record>(options.replay);
    take_over(s, load("beam", small, load_scene("beam", small)), false);
    const Settings own = s.loaded.sim().settings;
    LiveMap map = start_map(s.loaded.model, own, "substeps=2,5", "iterations=1", double(steps) * own.dt);
    while (!map.is_done()) {
      fill_map(map, 0.001);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    REQUIRE(map.cells[1].hash);
    CHECK(text(*map.cells[1].hash) == expected);
    while (steps_of(s.loaded.lanes) < steps) single_step(s);
    CHECK(text(state_hash(s.loaded.sim())) == expected);
    end_record(s);
  }
  CHECK(run_replay(options) == 0);
  CHECK(json::parse(read(options.out / "replay.json"))["lanes"][0]["state_hash"] == expected);
}

TEST_CASE("one run: in slices, in batches or at once it comes to the same numbers") {
  GlTest gl;
  const Scene scene = load_scene("beam", small);
  const auto model = build_model(scene);
  Sim sim = create_sim(model, scene.settings);
  Metrics metrics = create_metrics(sim);
  const MeasuredRun whole = run_to_end(sim, &metrics, steps);
  REQUIRE(whole.hash);
  for (const Pace pace : {Pace::each_step, Pace::queued, Pace::batches}) {
    reset(sim);
    Run run = begin(sim, &metrics, steps, {.pace = pace});
    CHECK_FALSE(advance(run, 0));
    long calls = 0;
    while (!advance(run, 1e-6)) ++calls;
    CHECK(calls > 1);
    const MeasuredRun sliced = finish(run);
    CHECK(sliced.hash == whole.hash);
    CHECK(sliced.steps == steps);
    REQUIRE(sliced.measurements.size() == whole.measurements.size());
    CHECK(sliced.measurements.back().centre == whole.measurements.back().centre);
  }
  // What a callback throws ends a run; the simulation can be used again.
  reset(sim);
  const auto cancel = [](long s) {
    if (s == 3) throw Interrupted();
  };
  CHECK_THROWS_AS(run_to_end(sim, nullptr, steps, {.stepped = cancel}), Interrupted);
  reset(sim);
  CHECK(run_to_end(sim, nullptr, steps).hash == whole.hash);
}

TEST_CASE("one run: a state that is not finite has no hash, and a baseline has one") {
  GlTest gl;
  const Scene scene = load_scene("beam", small);
  const auto model = build_model(scene);
  Sim sim = create_sim(model, scene.settings);
  State state = read_state(sim);
  state.velocities[5].x = NAN;
  write_state(sim, state);
  const MeasuredRun bad = run_to_end(sim, nullptr, steps);
  CHECK_FALSE(bad.errors.finite);
  CHECK_FALSE(bad.hash);
  CHECK(hash_json(bad.hash).is_null());
  const Baseline& rigid = baselines()[0];
  const auto hash = [&] { return rigid.run(*model, scene.settings, 3, {}).hash; };
  REQUIRE(hash());
  CHECK(hash() == hash());
}
