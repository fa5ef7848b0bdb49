// The window's past without a window: what is kept, what is shown again, and what is done again from a
// record.
#include <doctest/doctest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/window/record.h"
#include "app/window/session.h"
#include "sim/error.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

// Of little that falls, by default hard.
void open_block(Session& s) {
  s.playing = false;
  const Scene scene = load_scene("beam", {.solver = "hard", .set = {"bodies.0.block.cells=[3,2,2]"}});
  take_over(s, load("beam", {.set = {"bodies.0.block.cells=[3,2,2]"}}, scene), false);
}

std::vector<std::uint64_t> hashes(const Session& s) {
  std::vector<std::uint64_t> result;
  for (const Lane& lane : s.loaded.lanes) result.push_back(state_hash(lane.sim));
  return result;
}

// The n-th vertex that the scene does not hold.
std::uint32_t vertex(Session& s, int n) {
  std::uint32_t i = 0;
  while (!(s.loaded.sim().model->inverse_masses[i] > 0) || n-- > 0) ++i;
  return i;
}

RunOptions small(const std::filesystem::path& out) {
  RunOptions options;
  options.out = out;
  options.size = {64, 48};
  options.samples = 0;
  return options;
}

void step_to(Session& s, long step) {
  while (steps_of(s.loaded.lanes) < step) single_step(s);
}

}  // namespace

TEST_CASE("timeline: a budget keeps the start, all of late and ever fewer of long ago") {
  GlTest gl;
  Session s;
  s.measuring = false;
  open_block(s);
  REQUIRE(s.timeline.moments.size() == 1);
  const std::size_t each = s.timeline.bytes;
  s.timeline.budget = 24 * each + each / 2;
  step_to(s, 400);
  const auto& moments = s.timeline.moments;
  CHECK(moments.size() == 24);
  CHECK(s.timeline.bytes == 24 * each);
  CHECK(moments.front()->step == 0);
  for (std::size_t i = 1; i <= 4; ++i) CHECK(moments[moments.size() - i]->step == 401 - long(i));
  for (std::size_t i = 1; i + 1 < moments.size(); ++i) {
    CHECK(moments[i]->step > moments[i - 1]->step);
    CHECK(moments[i]->step - moments[i - 1]->step <= std::max(2l, (401 - moments[i - 1]->step) / 2));
  }
  show_step(s, 10);  // the nearest
  const long shown = steps_of(s.loaded.lanes);
  for (const auto& moment : moments) CHECK(std::abs(shown - 10) <= std::abs(moment->step - 10));
  single_step(s);
  CHECK(moments.back()->step == shown + 1);
  s.timeline.budget = each;
  restart(s);
  CHECK(s.messages.back().text.starts_with("no history: a state of"));
  single_step(s);
  CHECK(moments.empty());
  go_backward(s);
  go_forward(s);
  CHECK(steps_of(s.loaded.lanes) == 2);
  s.timeline.budget = 0;
  restart(s);
  CHECK(s.messages.empty());
}

TEST_CASE("timeline: lanes, pins and settings go back and forth") {
  GlTest gl;
  Session s;
  open_block(s);
  compare_lanes(s, {"hard", "mode=cpu-double,iterations=2"});
  step_to(s, 6);
  toggle_pin(s, vertex(s, 4));
  step_to(s, 12);
  const auto at_12 = hashes(s);
  for (int i = 0; i < 8; ++i) go_backward(s);
  CHECK(steps_of(s.loaded.lanes) == 4);
  for (const Lane& lane : s.loaded.lanes) CHECK_FALSE(is_pinned(lane.sim, vertex(s, 4)));
  CHECK_FALSE(s.loaded.disturbed);
  show_step(s, 8);
  for (const Lane& lane : s.loaded.lanes) CHECK(is_pinned(lane.sim, vertex(s, 4)));
  step_to(s, 12);
  CHECK(hashes(s) == at_12);
  Settings other = s.loaded.sim().settings;
  other.mode = "cpu";
  change_settings(s, other);
  show_step(s, 3);
  step_to(s, 5);
  CHECK(s.loaded.sim().settings.mode == "cpu");
  CHECK(s.timeline.moments.back()->step == 5);
  set_looping(s, true);
  for (int i = 0; i < 40; ++i) advance(s, 0.004);
  CHECK(s.timeline.moments.back()->step == 5);
  CHECK(steps_of(s.loaded.lanes) <= 5);
  Pick pick;
  pick.vertex = vertex(s, 9);
  catch_vertex(s, pick);
  CHECK_FALSE(s.timeline.looping);
  go_backward(s);
  CHECK_FALSE(s.grab);
  catch_vertex(s, pick);
  const long caught = steps_of(s.loaded.lanes);
  step_to(s, caught + 3);
  show_step(s, caught + 2);  // when the mouse held it
  for (const Lane& lane : s.loaded.lanes) CHECK_FALSE(is_pinned(lane.sim, pick.vertex));
  const State state = read_state(s.loaded.sim());
  step_to(s, caught + 4);
  CHECK(read_state(s.loaded.sim()).positions[pick.vertex] != state.positions[pick.vertex]);
}

TEST_CASE("timeline: a state that is not finite is not kept, and one before it is good") {
  GlTest gl;
  for (const char* mode : {"node", "cpu"}) {
    CAPTURE(mode);
    Session s;
    open_block(s);
    Settings settings = s.loaded.sim().settings;
    settings.mode = mode;
    change_settings(s, settings);
    step_to(s, 5);
    State state = read_state(s.loaded.sim());
    state.velocities[3].x = std::numeric_limits<double>::quiet_NaN();
    write_state(s.loaded.sim(), state);
    step_to(s, 8);
    watch_state(s);
    REQUIRE(s.messages.back().non_finite);
    CHECK(s.timeline.moments.back()->step == 4);
    go_backward(s);
    CHECK(steps_of(s.loaded.lanes) == 4);
    CHECK(s.messages.empty());
    step_to(s, 12);
    CHECK_FALSE(check_finite(s.loaded.sim(), true));
  }
}

TEST_CASE("record: what is done is done again without a window, to the same states") {
  const run_program::Folder folder;
  std::vector<std::uint64_t> wanted;
  const auto file = folder.path / "session.jsonl";
  {
    GlTest gl;
    Session s;
    s.record = std::make_unique<Record>(file);
    open_block(s);
    step_to(s, 3);
    add_lane(s, "mode=cpu-fast");
    step_to(s, 4);
    restart(s);
    step_to(s, 6);
    toggle_pin(s, vertex(s, 4));
    Pick pick;
    pick.vertex = vertex(s, 9);
    catch_vertex(s, pick);
    s.grab->target = s.grab->start + glm::dvec3(0, 1, 0);
    step_to(s, 10);
    let_go(s);
    Settings other = s.loaded.sim().settings;
    other.gravity = 5, other.omega = 1.25;
    change_settings(s, other);
    step_to(s, 15);
    show_step(s, 12);
    show_step(s, 8);
    change_speed(s, 2);
    s.view.look = Look::tets, s.view.cut = 0.5, s.overlaid = true;
    choose_colour(s, Colour::velocity);
    step_to(s, 14);
    show_step(s, 9);
    toggle_pin(s, vertex(s, 4));
    step_to(s, 11);
    wanted = hashes(s);
    end_record(s);
  }
  RunOptions options = small(folder.path / "again");
  options.replay = file;
  const auto looks = [](const std::filesystem::path& record) {
    std::vector<std::string> all;
    for (const auto& [where, json] : read_record(record))
      if (json.contains("view")) all.push_back(json.dump());
    return all;
  };
  REQUIRE(looks(file).size() == 2);
  CHECK(looks(file)[1].find(R"("look":"tets","colour":"velocity")") != std::string::npos);
  CHECK(run_replay(options) == 0);
  const auto result = nlohmann::json::parse(run_program::read(options.out / "replay.json"));
  CHECK(result["as_recorded"] == true);
  REQUIRE(result["lanes"].size() == wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i)
    CHECK(result["lanes"][i]["state_hash"] == fmt::format("{:016x}", wanted[i]));
}

TEST_CASE("record: a grab without a radius, as older ones are, is of one vertex") {
  const run_program::Folder folder;
  const auto file = folder.path / "session.jsonl";
  std::uint64_t wanted = 0;
  {
    GlTest gl;
    Session s;
    s.record = std::make_unique<Record>(file);
    open_block(s);
    s.grab_radius = 0;
    Pick pick;
    pick.vertex = vertex(s, 9);
    catch_vertex(s, pick);
    s.grab->target = s.grab->start + glm::dvec3(0, 1, 0);
    step_to(s, 6);
    let_go(s);
    step_to(s, 9);
    wanted = hashes(s)[0];
    end_record(s);
  }
  std::string text = run_program::read(file);
  const std::string later = ",\"lane\":0,\"radius\":0.0";
  REQUIRE(text.find(later) != std::string::npos);
  text.erase(text.find(later), later.size());
  std::ofstream(file) << text;
  RunOptions options = small(folder.path / "again");
  options.replay = file;
  CHECK(run_replay(options) == 0);
  CHECK(run_program::read(options.out / "replay.json").find(fmt::format("{:016x}", wanted)) != std::string::npos);
}

TEST_CASE("record: what cannot be done again is said, with its line") {
  const run_program::Folder folder;
  RunOptions options = small(folder.path / "out");
  options.replay = folder.path / "session.jsonl";
  CHECK_THROWS_WITH_AS(run_replay(options), doctest::Contains("cannot be read"), Error);
  const std::pair<const char*, const char*> wrong[] = {
      {"", "begins with a scene"},
      {R"({"step": 0, "reset": true})", "begins with a scene"},
      {R"({"step": 0, "load": {"scene": "none"}})", "no such scene"},
      {R"({"step": 0, "load": {"scene": "beam", "settings": {"fast": 1}}})", "session.jsonl:1"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\nfoo", "session.jsonl:2"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"pin\": 3}", "session.jsonl:2"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"jump\": 3}", "nothing known"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"pin\": 100000}", "no vertex 100000"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"pin\": \"a\"}", "session.jsonl:2"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"go\": \"a\"}", "session.jsonl:2"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 1, \"go\": 5}", "step 5 is not known"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"set\": {\"omega\": 9}}", "omega"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"view\": {\"look\": \"x\"}}", "no look"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"view\": {\"cut\": 1}}", "no line of"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"lane\": 2, \"set\": {}}", "no lane 3"},
      {"{\"step\": 0, \"load\": {\"scene\": \"beam\"}}\n{\"step\": 0, \"end\": [\"0\"]}", "other states than"},
  };
  for (const auto& [text, said] : wrong) {
    CAPTURE(text);
    std::ofstream(options.replay) << text << "\n";
    CHECK_THROWS_WITH_AS(run_replay(options), doctest::Contains(said), Error);
  }
}
