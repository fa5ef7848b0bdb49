// What the window does without a display: its panel's text, and a camera that follows.
#include <doctest/doctest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "app/bodies.h"
#include "app/commands.h"
#include "app/files.h"
#include "app/lab/reference_command.h"
#include "app/lab/run.h"
#include "app/window/edit_obstacles.h"
#include "app/window/preferences.h"
#include "app/window/session.h"
#include "app/window/ui.h"
#include "app/window/widgets.h"
#include "render/target.h"
#include "sim/contact/obstacle_kinds.h"
#include "sim/error.h"
#include "sim/model/material.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

// A small hard beam that falls, paused at its start.
void show_beam(Session& s) {
  Scene scene = load_scene("beam", {.solver = "hard"});
  scene.bodies[0].fixed.clear();
  scene.bodies[0].block->cells = {3, 2, 2};
  s.playing = false;
  take_over(s, load("beam", {}, scene), false);
}

}  // namespace

TEST_CASE("window: every setting's label fits its column, whatever fonts the machine has") {
  ImGui::CreateContext();
  for (const float scale : {1.0f, 1.5f, 2.0f}) {
    set_style(scale, 1);
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    ImGui::GetIO().Fonts->GetTexDataAsAlpha8(&pixels, &width, &height);
    CHECK(ImGui::GetIO().Fonts->Fonts[0]->FontSize == doctest::Approx(14 * scale));
    ImGui::GetIO().DisplaySize = {100, 100};
    ImGui::NewFrame();
    for (const Parameter& row : parameters()) {
      const std::string label = label_of(row.name.c_str());
      CAPTURE(label);
      CHECK(ImGui::CalcTextSize(label.c_str()).x < label_width());
    }
    ImGui::EndFrame();
  }
  ImGui::DestroyContext();
}

TEST_CASE("window: the camera follows bodies that go away, smoothly, and keeps where it was dragged") {
  GlTest gl;
  Scene scene;
  scene.bodies.emplace_back();
  scene.bodies[0].block.emplace();
  scene.settings.iterations = scene.settings.substeps = 1;
  Session s;
  s.view.follow = true;
  take_over(s, load("block", {}, scene), false);
  const Target target = make_target(64, 48);
  const glm::vec3 start{0, 0.5f, 0}, way{5, 0, -2};  // its middle, and how far it goes
  const auto frames = [&](int count) {
    bool moving = false;
    for (int i = 0; i < count; ++i) {
      draw(s.loaded.renderer, make_frame(s.loaded.sim(), s.camera, s.view, target));
      glFinish();
      moving = follow_bodies(s, 0.05);
    }
    return moving;
  };
  CHECK_FALSE(frames(80));
  CHECK(glm::distance(s.camera.target, start) < 0.01f * s.camera.distance);
  State state = read_state(s.loaded.sim());
  for (glm::dvec3& p : state.positions) p += glm::dvec3(way);
  write_state(s.loaded.sim(), state);
  CHECK(frames(2));
  CHECK(glm::distance(s.camera.target, start) < 0.5f * glm::length(way));  // no jump
  CHECK_FALSE(frames(80));
  CHECK(glm::distance(s.camera.target, start + way) < 0.01f * s.camera.distance);
  s.beside = {0, 1, 0};  // dragged
  frames(80);
  CHECK(glm::distance(s.camera.target, start + way + s.beside) < 0.01f * s.camera.distance);
  s.view.follow = false;
  reset(s.loaded.sim());
  frames(10);
  CHECK(glm::distance(s.camera.target, start + way + s.beside) < 0.01f * s.camera.distance);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("window: lanes share the view out, their words are settings, the finest one is the yardstick") {
  for (std::size_t count = 1; count <= most_lanes; ++count)
    for (const auto& [width, height] : {std::pair(1000, 700), {301, 999}, {2, 2}}) {
      std::vector<int> drawn(std::size_t(width * height));
      for (std::size_t lane = 0; lane < count; ++lane) {
        const Viewport tile = tile_of(lane, count, width, height);
        for (int y = tile.y; y < tile.y + tile.height; ++y)
          for (int x = tile.x; x < tile.x + tile.width; ++x) ++drawn.at(std::size_t(y * width + x));
      }
      CHECK(std::ranges::max(drawn) == 1);
      if (width > 2) CHECK(std::ranges::min(drawn) == 1);
    }
  const Settings own;
  CHECK(lane_settings(own, "hard,substeps=7", "--lane").substeps == 7);
  CHECK(lane_settings(own, "rubber,mode=explicit", "--lane").poisson_ratio == 0.48);
  CHECK(lane_settings(own, "", "--lane") == own);
  const Settings of_one = lane_settings(own, "bodies.1.young_modulus=2e4,bodies.1.friction=0.9", "--lane", nullptr, 3);
  REQUIRE(of_one.bodies.size() == 3);
  CHECK(material_of(of_one, 1).young_modulus == 2e4);
  CHECK(friction_of(of_one, 1) == 0.9);
  CHECK(material_of(of_one, 2) == static_cast<const Material&>(own));
  CHECK_THROWS_WITH(lane_settings(own, "bodies.3.friction=0.9", "--lane", nullptr, 3), doctest::Contains("no body 3"));
  CHECK_THROWS_AS(lane_settings(own, "bodies.1.dt=0.9", "--lane", nullptr, 3), Error);
  CHECK(lane_settings(own, "budget_ms=2", "--lane") == own);  // nothing to try it on
  for (const char* none : {"budget_ms=", "budget_ms=-1", "budget_ms=2ms", "budget_ms=inf"})
    CHECK_THROWS_WITH_AS(lane_settings(own, none, "--lane"), doctest::Contains("is no time"), Error);
  CHECK_THROWS_WITH_AS(lane_settings(own, "fast", "--lane fast"), doctest::Contains("'fast' is no solver"), Error);
  CHECK(lane_settings(own, "gauss-seidel", "--lane") == lane_settings(own, "mode=gauss-seidel", "--lane"));
  CHECK_THROWS_WITH_AS(lane_settings(own, "mode=newton", "--lane"), doctest::Contains("needs forces"), Error);
  for (const Comparison& row : comparisons()) {
    CAPTURE(row.name);
    CHECK(row.lanes.size() <= most_lanes);
    Settings soft = own;
    apply_preset(soft, material_presets(), "rubber");
    for (const std::string& words : row.lanes) CHECK_NOTHROW(lane_settings(soft, words, row.name));
  }
}

TEST_CASE("window: lanes step together from a common start, and are held against the reference motion") {
  GlTest gl;
  Session s;
  show_beam(s);
  single_step(s);
  compare_lanes(s, {"paper,substeps=1,iterations=1", "hard", "fastest"});
  CHECK(s.messages.size() == 1);  // no such word: nothing changed
  CHECK(s.loaded.lanes.size() == 1);
  CHECK(s.loaded.sim().steps == 1);
  compare_lanes(s, {"paper,iterations=1", "hard", "mode=cpu-double,iterations=20"});
  REQUIRE(s.loaded.lanes.size() == 3);
  REQUIRE(s.loaded.right);
  CHECK(yardstick(s.loaded.lanes) == 2);
  for (int i = 0; i < 60; ++i) single_step(s);
  for (const Lane& lane : s.loaded.lanes) {
    CHECK(lane.sim.steps == 60);
    REQUIRE(!lane.distance.values.empty());
    // As a run of its own says.
    const MeasuredRun run = run_model(lane.sim.model, lane.sim.settings, 60, &*s.loaded.right);
    CHECK(lane.distance.values.back() == doctest::Approx(100 * run.motion->final).epsilon(1e-4));
  }
  Settings other = s.loaded.sim().settings;
  other.gravity = 3;
  change_settings(s, other);
  for (const Lane& lane : s.loaded.lanes) CHECK(lane.sim.settings.gravity == 3);
  CHECK(s.loaded.disturbed);
  CHECK(s.loaded.comparable);
  restart(s);
  CHECK(s.loaded.right);
  CHECK_FALSE(s.loaded.disturbed);
  toggle_pin(s, 0);
  for (const Lane& lane : s.loaded.lanes) CHECK(is_pinned(lane.sim, 0));
  choose_lane(s, 2);
  remove_lane(s, s.loaded.chosen);
  CHECK(s.loaded.lanes.size() == 2);
  CHECK(s.loaded.chosen == 1);
  for (const Lane& lane : s.loaded.lanes) CHECK(lane.sim.steps == 0);
  for (int i = 0; i < 5; ++i) add_lane(s);
  CHECK(s.loaded.lanes.size() == most_lanes);
  add_lane(s, "material=neo-hookean,mode=node");
  compare_lanes(s, {"hard", "material=neo-hookean"});
  CHECK_FALSE(s.loaded.comparable);
  compare_lanes(s, {});
  CHECK(s.loaded.lanes.size() == 1);
}

TEST_CASE("window: the probe says what a vertex and its tet measure, colours how far each is from right") {
  GlTest gl;
  Session s;
  show_beam(s);
  CHECK_FALSE(s.loaded.right);  // one alone is held against nothing
  choose_colour(s, Colour::energy);
  CHECK(s.messages.back().text == "this needs a material");
  CHECK(has_colour(s, Colour::residual));
  choose_colour(s, Colour::motion);
  REQUIRE(s.loaded.right);
  const Target target = make_target(64, 48);
  draw_lanes(s, target);
  CHECK(s.loaded.held == 0);
  while (s.loaded.held < 40) single_step(s);
  const Sim& sim = s.loaded.sim();
  const Model& model = *sim.model;
  const auto kept = std::ranges::find(s.loaded.right->kept, s.loaded.held) - s.loaded.right->kept.begin();
  const State state = read_state(sim);
  const auto apart = s.loaded.lane().apart.read_all<float>();
  for (std::size_t v = 0; v < apart.size(); ++v)
    CHECK(
        double(apart[v]) ==
        doctest::Approx(glm::distance(state.positions[v], s.loaded.right->positions[std::size_t(kept)][v]) / model.size)
            .epsilon(1e-3)
            .scale(1e-4));
  s.view.worst = true;
  for (int i = 0; i < 2; ++i) {  // what was asked for at the start arrives first
    draw_lanes(s, target);
    glFinish();
    find_worst(s);
  }
  REQUIRE(!s.worst.empty());
  CHECK(s.worst[0].second == std::ranges::max(apart));
  const auto with = [&](bool checked, bool pointed_at) {
    s.view.flattest = checked, s.ui.at_flattest = pointed_at;
    draw_lanes(s, target);
    return read_rgba(target).rgba;
  };
  const auto plain = with(false, false), edged = with(true, false);
  CHECK(edged != plain);
  CHECK(with(false, true) == edged);
  CHECK(with(false, false) == plain);
  CHECK(s.loaded.flattest.altitude == report(model.rest).worst_altitude);

  const glm::dvec3 aim = 0.5 * (bounds(state.positions).low + bounds(state.positions).high);
  ask(s.loaded.probe, s.loaded.lanes, 0, s.loaded.renderer, shown_frame(s, 0),
      {glm::vec3(aim) + glm::vec3(0, 5, 0.01f), {0, -1, 0}});
  CHECK(s.loaded.probe.asked());
  CHECK(take_reading(s.loaded.probe, s.loaded.lanes, true));
  REQUIRE(s.loaded.probe.reading);
  const Reading& r = *s.loaded.probe.reading;
  CHECK(std::ranges::count(model.rest.tets[r.tet], r.vertex) == 1);
  CHECK(glm::distance(r.position, state.positions[r.vertex]) < 1e-9);
  CHECK(r.speed == doctest::Approx(glm::length(state.velocities[r.vertex])).epsilon(1e-6));
  const std::vector<Tet> tet{model.rest.tets[r.tet]};
  const double ratio = tet_volumes({state.positions, tet, {}})[0] / tet_volumes({model.rest.positions, tet, {}})[0];
  CHECK(r.volume == doctest::Approx(ratio - 1).epsilon(1e-2).scale(1e-4));
  CHECK(*r.distance == doctest::Approx(double(apart[r.vertex])));
  CHECK_FALSE(r.energy);
  ask(s.loaded.probe, s.loaded.lanes, 0, s.loaded.renderer, shown_frame(s, 0),
      {glm::vec3(0, 50, 0), {0, 1, 0}});  // beside it
  CHECK(take_reading(s.loaded.probe, s.loaded.lanes, true));
  CHECK_FALSE(s.loaded.probe.reading);
  choose_colour(s, Colour::patch);
  CHECK(has_colour(s, Colour::patch));
  draw_lanes(s, target);
  const auto patches = s.loaded.lane().patches.read_all<float>();
  CHECK(std::ranges::is_sorted(patches));  // of neighbours in number
  CHECK(patches.back() + 1 == float(sim.solver.vertex_patches));
  choose_colour(s, Colour::motion);
  toggle_pin(s, 0);  // no longer the scene's motion
  draw_lanes(s, target);
  CHECK_FALSE(s.loaded.lane().apart);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("window: a history is all of it in even steps, and the newest, plots are copied and saved (long)") {
  History history;
  for (int i = 0; i < 30000; ++i) {
    history.add(i, 0.5 * i);
    REQUIRE(history.values.size() <= History::most);
    REQUIRE(history.values.back() == float(i));
  }
  CHECK(history.values.size() > History::most / 2);
  for (std::size_t k = 0; k + 1 < history.values.size(); ++k) {
    CHECK(history.values[k] == float(8 * k));
    CHECK(history.times[k] == 4.0 * double(k));
  }

  CHECK(history.at(400.0) == 800.0f);
  CHECK_FALSE(history.at(-1).has_value());
  history.add(7, 402);  // somebody went back
  CHECK(history.values.back() == 7);
  CHECK(history.values.size() == 102);
  for (int i = 1; i < 9; ++i) history.add(7 + i, 402 + i);
  CHECK(history.times[history.times.size() - 2] == 409);  // eight steps on from 400, of which each eighth is kept
  CHECK(history.values.back() == 15);

  GlTest gl;
  Session s;
  show_beam(s);
  compare_lanes(s, {"hard", "mode=cpu,iterations=3"});
  for (int i = 0; i < 40; ++i) single_step(s);
  const PlotRow& distance = plot_rows()[4];
  const Chart chart = plot_chart(s, distance);
  REQUIRE(chart.series.size() == 2);
  CHECK(chart.series[0].points.size() == s.loaded.lanes[0].distance.values.size());
  CHECK(chart.series[1].points.back().x == doctest::Approx(s.loaded.lanes[1].distance.times.back()));
  CHECK(to_svg(chart).find("distance from the reference motion") != std::string::npos);
  const std::string csv = plot_csv(s, distance);
  CHECK(csv.starts_with("lane,time [s],distance from the reference motion [%]\n\"node, 5 substeps\",0"));
  CHECK(std::ranges::count(csv, '\n') == 1 + 2 * std::ssize(chart.series[0].points));
  const Measurement now = measure_now(*s.loaded.lanes[0].metrics, s.loaded.lanes[0].sim);
  CHECK(double(s.loaded.lanes[0].energy.values.back()) == doctest::Approx(now.energy()).epsilon(0.2));
  const PlotRow& depth = plot_rows().back();
  REQUIRE(!s.loaded.lane().depth.values.empty());
  for (const float d : s.loaded.lane().depth.values) CHECK(d == 0);  // far from the ground
  restart(s);
  CHECK(plot_chart(s, distance).series.empty());
  take_over(s, load("stack", {}, load_scene("stack")), false);
  for (int i = 0; i < 24; ++i) single_step(s), glFinish();
  const auto depths = plot_chart(s, depth).series.at(0).points;
  REQUIRE(!depths.empty());
  for (const glm::dvec2& d : depths) CHECK(d.y < 0.5);  // % of a cube, on the ground
  Sim& sim = s.loaded.lane().sim;
  const State state = read_state(sim);
  const auto lowest = std::ranges::min_element(state.positions, {}, &glm::dvec3::y);
  const auto vertex = std::uint32_t(lowest - state.positions.begin());
  pin(sim, vertex), move_pinned(sim, vertex, {lowest->x, -5e-4, lowest->z});
  for (int i = 0; i < 24; ++i) single_step(s), glFinish();
  const auto pressed = plot_chart(s, depth).series.at(0).points;
  const glm::dvec2 deepest = *std::ranges::max_element(pressed, {}, &glm::dvec2::y);
  CHECK(deepest.y > 0);
  CHECK(deepest.y < 0.5);
}

TEST_CASE("window: a map is filled a little in every frame, each cell as a run of its own comes out") {
  GlTest gl;
  Scene scene = load_scene("beam", {.solver = "hard"});
  scene.bodies[0].fixed.clear();
  scene.bodies[0].block->cells = {3, 2, 2};
  scene.duration = 0.2;
  Session s;
  s.playing = false;
  take_over(s, load("beam", {}, scene), false);
  const auto fill = [&](const Settings& base, const char* x, const char* y) {
    s.loaded.map = start_map(s.loaded.sim().model, base, x, y, scene.duration);
    int frames = 0;
    for (; is_filling(s); ++frames) {
      fill_map(s);
      glFinish();
      if (s.loaded.map->search) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    CHECK(frames > 1);
    CHECK(s.messages.empty());
    return s.loaded.map->cells;
  };
  const Settings own = s.loaded.sim().settings;
  for (const MapCell& cell : fill(own, "substeps=1,5", "dt=0.005,0.02")) {
    REQUIRE(cell.state == MapCell::finished);
    const long steps = std::lround(scene.duration / cell.settings.dt);
    const auto right = rigid_motion(*s.loaded.sim().model, cell.settings, steps);
    Sim sim = create_sim(s.loaded.sim().model, cell.settings);
    MotionError error;
    for (long i = 0; i <= steps; ++i) {
      if (i > 0) step(sim);
      if (i == steps || i % std::max(1l, steps / 16) == 0) add_state(error, *right, *sim.model, i, read_state(sim));
    }
    CHECK(cell.percent == doctest::Approx(100 * error.rms).epsilon(1e-6));
    CHECK(cell.hash == state_hash(sim));
  }
  CHECK_FALSE(s.loaded.map->sim);  // done: it holds nothing
  // A material's reference motion is found meanwhile; what a mode does not take is said.
  Settings soft = lane_settings(own, "foam,mode=explicit", "");
  soft.stability = 0.01;
  const auto cells = fill(soft, "young_modulus=1e5,1e12", "omega=1,1.5");
  CHECK(s.loaded.map->order == std::vector<std::size_t>{0, 2, 1, 3});
  CHECK(cells[0].state == MapCell::finished);
  CHECK(cells[0].percent < 0.1);
  CHECK(cells[1].state == MapCell::refused);
  CHECK(cells[1].why.find("too stiff") != std::string::npos);
  CHECK_THROWS_WITH_AS(start_map(s.loaded.sim().model, own, "mode=1,2", "dt=0.01", 1),
                       doctest::Contains("'mode' cannot be '1'"), Error);
  s.loaded.map = start_map(s.loaded.sim().model, soft, "young_modulus=1e5,1e6", "damping=0,1", 5);
  fill_map(s);  // and left while its motion is being found
  s.loaded.map.reset();
  CHECK(gl_error_count() == 0);
}

TEST_CASE("window: a map that is being filled keeps the obstacles it began with while these are edited") {
  GlTest gl;
  Scene scene = load_scene("beam", {.solver = "hard"});
  scene.bodies[0].block->cells = {3, 2, 2};
  scene.bodies[0].fixed.clear();
  scene.settings.gravity = 3;
  const auto fill = [&](bool edited) {
    Session s;
    s.playing = false;
    take_over(s, load("beam", {}, scene), false);
    const auto began = s.loaded.model;
    s.loaded.map = start_map(began, s.loaded.sim().settings, "substeps=1,4", "dt=0.005,0.02", 0.3);
    for (int frame = 0; is_filling(s); ++frame) {
      fill_map(s);
      glFinish();
      if (!edited || frame > 8) continue;
      Obstacle floor;
      floor.normal = {0, 1, 0}, floor.centre = {0, -0.1 - 0.01 * frame, 0};
      if (frame % 2) floor.friction = 0.1;  // which needs other kernels
      change_obstacles(s, {floor});
      CHECK(s.loaded.sim().model == s.loaded.model);
      CHECK(s.loaded.map->model == began);
      step_lanes(s);
    }
    CHECK(began->obstacles.empty());
    CHECK(s.loaded.model->obstacles.size() == std::size_t(edited));
    std::vector<double> percents;
    for (const MapCell& cell : s.loaded.map->cells) percents.push_back(cell.percent);
    return percents;
  };
  CHECK(fill(true) == fill(false));
}

TEST_CASE("window: changes of settings are taken back and done again, and errors go with what mends them") {
  GlTest gl;
  Session s;
  show_beam(s);
  const Settings own = s.loaded.own;
  CHECK(own == s.loaded.sim().settings);
  const auto set = [&](auto member, auto value) {
    Settings wanted = s.loaded.sim().settings;
    wanted.*member = value;
    change_settings(s, wanted);
  };
  const auto now = [&]() -> const Settings& { return s.loaded.sim().settings; };
  undo(s);
  CHECK(s.messages.back().text == "nothing to undo");
  set(&Settings::omega, 1.2);
  set(&Settings::omega, 1.3);  // the slider is still held
  s.changes.open = false;
  set(&Settings::gravity, 5.0);
  s.changes.open = false;
  undo(s);
  CHECK(now().gravity == own.gravity);
  CHECK(now().omega == 1.3);
  undo(s);
  CHECK(now() == own);
  redo(s);
  redo(s);
  CHECK(now().gravity == 5);
  undo(s);
  set(&Settings::friction, 0.1);  // what was taken back is forgotten
  CHECK(s.changes.future.empty());
  set(&Settings::mode, "newton");
  CHECK(s.messages.back().error);
  CHECK(now().mode == "node");
  set(&Settings::friction, 0.2);
  CHECK(std::ranges::none_of(s.messages, &Message::error));
  add_lane(s);
  set(&Settings::gravity, 3.0);
  s.changes.open = false;
  undo(s);
  for (const Lane& lane : s.loaded.lanes) CHECK(lane.sim.settings.gravity == own.gravity);
}

TEST_CASE("window: lanes, pins and materials of bodies are taken back too, and a record does that again") {
  const run_program::Folder folder;
  const auto file = folder.path / "session.jsonl";
  std::vector<std::uint64_t> wanted;
  {
    GlTest gl;
    Session s;
    s.record = std::make_unique<Record>(file);
    s.playing = false;
    take_over(s, load("stack", {}, load_scene("stack")), false);
    const auto pinned = [&](std::uint32_t v) { return is_pinned(s.loaded.lanes.front().sim, v); };
    const auto steps = [&](int count) {
      for (int i = 0; i < count; ++i) single_step(s);
    };
    steps(2);
    toggle_pin(s, 3);
    toggle_pin(s, 7);
    steps(2);
    undo(s);
    CHECK(pinned(3));
    CHECK_FALSE(pinned(7));
    CHECK(s.loaded.sim().steps == 4);
    undo(s), redo(s);
    CHECK(pinned(3));
    steps(2);
    toggle_pin(s, 3);
    undo(s);
    CHECK(pinned(3));

    const Settings of_one = s.loaded.sim().settings;
    Settings soft = with_body_changed(of_one, settings_for_body(of_one, 0), 0, s.loaded.model->bodies.size());
    soft.bodies[0].material->young_modulus *= 2;
    change_settings(s, soft);
    s.changes.open = false;
    steps(1);
    undo(s);
    CHECK(s.loaded.sim().settings == of_one);
    redo(s);
    CHECK(s.loaded.sim().settings == soft);
    compare_lanes(s, {"mode=node", "mode=node,substeps=3", "mode=node,substeps=4"});
    CHECK(s.loaded.lanes.size() == 3);
    steps(2);
    undo(s);
    REQUIRE(s.loaded.lanes.size() == 1);
    CHECK(s.loaded.sim().settings == soft);
    CHECK(s.loaded.sim().steps == 0);
    redo(s);
    REQUIRE(s.loaded.lanes.size() == 3);
    choose_lane(s, 1);
    remove_lane(s, s.loaded.chosen);
    undo(s);
    REQUIRE(s.loaded.lanes.size() == 3);
    CHECK(s.loaded.lanes[1].sim.settings.substeps == 3);
    steps(3);
    for (const Lane& lane : s.loaded.lanes) wanted.push_back(state_hash(lane.sim));
    CHECK(gl_error_count() == 0);
    end_record(s);
  }
  RunOptions options;
  options.out = folder.path / "again", options.replay = file, options.size = {64, 48}, options.samples = 0;
  CHECK(run_replay(options) == 0);
  const auto result = nlohmann::json::parse(run_program::read(options.out / "replay.json"));
  CHECK(result["as_recorded"] == true);
  for (std::size_t i = 0; i < wanted.size(); ++i)
    CHECK(result["lanes"][i]["state_hash"] == fmt::format("{:016x}", wanted[i]));
}

TEST_CASE("window: obstacles come, move, turn and go while bodies go on, and all of it is taken back") {
  GlTest gl;
  for (const char* mode : {"node", "cpu-fast"}) {
    CAPTURE(mode);
    Scene scene = load_scene("beam", {.solver = "hard", .parameters = {{"mode", mode}}});
    scene.bodies[0].block->cells = {3, 2, 2};
    Session s;
    take_over(s, load("beam", {}, scene), false);
    for (int i = 0; i < 3; ++i) step_lanes(s);
    const auto& all = s.loaded.scene.obstacles;
    for (const char* name : {"box", "half-space", "height-field", "cylinder"}) {
      add_obstacle(s, *find_obstacle_kind(name));
      s.changes.open = false;
      step_lanes(s);
      CHECK(all.back().kind->name == std::string(name));
    }
    CHECK(s.loaded.sim().steps == 7);  // it goes on
    CHECK(s.obstacle == 3);
    CHECK(s.loaded.model->obstacles.size() == 4);
    std::vector<Obstacle> wanted = all;
    const glm::dvec3 before = wanted[0].centre;
    move_by(wanted[0], {1, 2, 3});
    turn_by(wanted[0], rotation_of({10, 20, 30}));
    turn_by(wanted[0], rotation_of({0, 40, 0}));
    change_obstacles(s, wanted);
    s.changes.open = false;
    const glm::dmat3 turned = rotation_of({0, 40, 0}) * rotation_of({10, 20, 30});
    for (int axis = 0; axis < 3; ++axis)
      CHECK(glm::distance(pose_at(s.loaded.model->obstacles[0], 0).axes[axis], turned[axis]) < 1e-9);
    const Ray down{glm::vec3(before + glm::dvec3(1, 9, 3)), {0, -1, 0}};
    const auto hit = obstacle_on(s, down);
    REQUIRE(hit);
    CHECK(hit->number == 0);
    CHECK_FALSE(obstacle_on(s, {{50, 50, 50}, {0, 1, 0}}));
    undo(s);
    CHECK(all[0].centre == before);
    remove_obstacle(s);
    CHECK(all.size() == 3);
    step_lanes(s);
    wanted = all;
    wanted[0].velocity = {1, 0, 0};
    change_obstacles(s, wanted);
    CHECK(s.loaded.sim().steps == 0);  // it moves otherwise: anew
    for (int i = 0; i < 5; ++i) undo(s), s.changes.open = false;
    CHECK(all.empty());
    const std::size_t count = all.size();
    s.ui.mesh = "no.ply";
    add_obstacle(s, *find_obstacle_kind("mesh"));
    CHECK(s.messages.back().error);
    CHECK(all.size() == count);
    CHECK_FALSE(check_finite(s.loaded.sim(), true));
  }
  CHECK(gl_error_count() == 0);
}

TEST_CASE("window: a saved scene is loaded as it was, a file that fails leaves an error until one works") {
  GlTest gl;
  const run_program::Folder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path);
  {
    Session s;
    show_beam(s);
    Settings wanted = s.loaded.sim().settings;
    wanted.gravity = 4, wanted.constraints = "stretch,volume", wanted.dt = 0.003;
    change_settings(s, wanted);
    s.camera.azimuth = 12;
    save_scene(s);
    REQUIRE(std::filesystem::exists("beam_000.json"));
    CHECK(read_png("beam_000.png")->width == picture_width);
    REQUIRE(s.ui.kept.recent.size() == 1);
    const auto load_now = [&](const char* file) {
      open_file(s, file);
      attempt(s, std::exchange(s.task, std::nullopt)->act);
    };
    std::ofstream("bad.ply") << "this is no mesh";
    load_now("bad.ply");
    CHECK(s.messages.back().error);
    load_now(s.ui.kept.recent[0].c_str());
    CHECK(s.messages.empty());
    CHECK(s.loaded.sim().settings == wanted);
    CHECK(s.loaded.own == wanted);
    CHECK(s.camera.azimuth == 12);
    for (int i = 0; i < 9; ++i) single_step(s);
    Session again;
    show_beam(again);
    change_settings(again, wanted);
    restart(again);
    for (int i = 0; i < 9; ++i) single_step(again);
    CHECK(state_hash(s.loaded.sim()) == state_hash(again.loaded.sim()));
    CHECK(s.ui.kept.recent.size() == 1);
  }
  std::filesystem::current_path(before);
}

TEST_CASE("scene: every shipped one is written as it is read, and has a picture") {
  const run_program::Folder folder;
  for (const std::string& name : scene_names()) {
    CAPTURE(name);
    const Scene scene = load_scene(name);
    const auto file = folder.path / (name + ".json");
    std::ofstream(file) << scene_json(scene).dump();
    const Scene again = load_scene(file.string());
    CHECK(again.settings == scene.settings);
    CHECK(scene_json(again).dump() == scene_json(scene).dump());
    const auto picture = read_png(models_folder() / "scenes" / (name + ".png"));
    REQUIRE(picture);
    CHECK(picture->width == picture_width);
  }
}

TEST_CASE("window: what it keeps is kept, a damaged file is as none") {
  const run_program::Folder folder;
  const auto file = folder.path / "new" / "window.json";
  CHECK(read_preferences(file) == Preferences());
  Preferences kept{.dark = true, .panel = 400, .text = 1.5, .open = {{"View", false}, {"Contact", true}}};
  for (int i = 0; i < 12; ++i) remember(kept, fmt::format("/a/{}.ply", i % 10));
  CHECK(kept.recent.size() == 8);
  CHECK(kept.recent[0] == "/a/1.ply");
  write_preferences(file, kept);
  CHECK(read_preferences(file) == kept);
  const std::string whole = run_program::read(file);
  for (std::size_t length = 0; length + 2 < whole.size(); length += 7) {
    std::ofstream(file) << whole.substr(0, length);
    CHECK(read_preferences(file) == Preferences());
  }
  for (const char* wrong : {"[]", "{\"dark\": 3}", "{\"recent\": [1]}", "{\"open\": {\"a\": \"b\"}}", "null", "\xff"}) {
    CAPTURE(wrong);
    std::ofstream(file) << wrong;
    CHECK(read_preferences(file) == Preferences());
  }
  std::ofstream(file) << R"({"panel": 1e300, "text": -1})";
  CHECK(read_preferences(file).panel == most_panel);
  CHECK(read_preferences(file).text == least_text);
}

TEST_CASE("window: what the mouse holds follows it without a spike, in every lane, out of the ground") {
  GlTest gl;
  Session s;
  show_beam(s);
  add_lane(s);
  const Sim& sim = s.loaded.sim();
  const TetMesh& rest = sim.model->rest;
  Pick pick;  // a corner at the end
  const auto along = [&](std::uint32_t a, std::uint32_t b) {
    return glm::dot(rest.positions[a], glm::dvec3(1, 0.1, 0.1)) < glm::dot(rest.positions[b], glm::dvec3(1, 0.1, 0.1));
  };
  for (std::uint32_t v = 0; v < rest.positions.size(); ++v)
    if (along(pick.vertex, v)) pick.vertex = v;
  const auto close = [&](double radius) { return take_hold(sim, pick.vertex, radius).vertices; };
  CHECK(close(0) == std::vector{pick.vertex});
  s.grab_radius = 0.45;
  catch_vertex(s, pick);
  REQUIRE(s.hold);
  CHECK(s.hold->caught() == pick.vertex);
  CHECK(s.hold->vertices.size() > 8);
  CHECK(s.hold->vertices.size() < rest.positions.size());
  for (const Lane& lane : s.loaded.lanes)
    for (const std::uint32_t v : s.hold->vertices) CHECK(is_pinned(lane.sim, v));
  const glm::dvec3 up(0, 3, 0);
  s.grab->target = s.grab->start + up;
  for (int i = 0; i < 40; ++i) single_step(s);
  const State state = read_state(sim);
  for (std::size_t i = 0; i < s.hold->vertices.size(); ++i) {
    const std::uint32_t v = s.hold->vertices[i];
    const double moved = state.positions[v].y - s.hold->starts[i].y;
    const double led = s.grab->position.y - s.grab->start.y;
    CHECK(moved == doctest::Approx(led - s.hold->behind[i] * s.hold->slack).epsilon(1e-5));
    CHECK(read_state(s.loaded.lanes[0].sim).positions[v] == state.positions[v]);
  }
  CHECK(s.grab->position.y > s.grab->start.y + s.hold->slack);
  move_held(s.loaded.lane().sim, *s.hold, s.hold->starts[0] - glm::dvec3(0, 9, 0));
  step(s.loaded.lane().sim);
  const State below = read_state(sim);
  for (std::size_t i = 1; i < s.hold->vertices.size(); ++i) CHECK(below.positions[s.hold->vertices[i]].y > -1e-6);
  const auto held = s.hold->vertices;
  let_go(s);
  for (const Lane& lane : s.loaded.lanes)
    for (const std::uint32_t v : held) CHECK_FALSE(is_pinned(lane.sim, v));
  // A pin of the user's stays where it is, and is led alone.
  toggle_pin(s, held[1]);
  CHECK(std::ranges::count(close(0.45), held[1]) == 0);
  CHECK(take_hold(sim, held[1], 0.45).vertices == std::vector{held[1]});
}

TEST_CASE("window: however much the mouse holds, leading it makes one buffer once") {
  GlTest gl;
  Session s;
  show_beam(s);
  Sim& sim = s.loaded.lane().sim;
  const Hold hold = take_hold(sim, 0, 0.45);
  REQUIRE(hold.vertices.size() > 8);
  static int made;
  static const auto of_driver = __glewGenBuffers;
  __glewGenBuffers = [](GLsizei count, GLuint* names) { made += count, of_driver(count, names); };
  const auto writes = [&](const auto& action) { return made = 0, action(), made; };
  CHECK(writes([&] { pin_held(sim, hold); }) <= 2);  // masses and velocities
  const glm::dvec3 to = hold.starts.front() + glm::dvec3(0, 0.1, 0);
  const auto led = [&] { move_held(sim, hold, to), step(sim); };
  const int without = writes([&] { step(sim); });
  CHECK(writes(led) <= without + 1);
  CHECK(glm::distance(read_state(sim).positions[0], to) < 1e-6);
  CHECK(writes(led) <= without + 1);  // that writes the places
  CHECK(writes([&] { unpin_held(sim, hold); }) == 1);
  __glewGenBuffers = of_driver;
}

TEST_CASE("window: a hidden body is not drawn and not picked, and moves on") {
  GlTest gl;
  Session s;
  s.playing = false;
  take_over(s, load("stack", {}, load_scene("stack")), false);
  const Target target = make_target(96, 128);
  const auto picture = [&](Look look, double cut) {
    s.view.look = look, s.view.cut = cut;
    s.view.follow = false;
    draw_lanes(s, target);
    return read_rgba(target).rgba;
  };
  const auto picked = [&](bool inside) {  // from above
    s.view.cut = inside ? 0.9 : 1, s.view.cut_axis = 0;
    const glm::vec3 above = glm::vec3(bounds(s.loaded.model->positions).centre()) + glm::vec3(0, 5, 0);
    request(s.loaded.picker, s.loaded.renderer, shown_frame(s, 0), {above, {0, -1, 0}});
    const Pick pick = *poll(s.loaded.picker, true);
    REQUIRE(pick.hit);
    return body_at(*s.loaded.model, pick.vertex).number;
  };
  const std::size_t top = s.loaded.model->bodies.size() - 1;
  std::vector<std::vector<std::uint8_t>> whole;
  const std::tuple<Look, double> ways[] = {{Look::surface, 1}, {Look::tets, 1}, {Look::graph, 1}, {Look::surface, 0.6}};
  for (const auto& [look, cut] : ways) whole.push_back(picture(look, cut));
  CHECK(picked(false) == top);
  CHECK(picked(true) == top);
  hide_body(s, top, true);
  for (std::size_t i = 0; i < whole.size(); ++i) CHECK(picture(std::get<0>(ways[i]), std::get<1>(ways[i])) != whole[i]);
  CHECK(picked(false) == top - 1);
  CHECK(picked(true) == top - 1);
  const double before = read_state(s.loaded.sim()).positions[s.loaded.model->bodies[top].first_vertex].y;
  for (int i = 0; i < 5; ++i) single_step(s);
  CHECK(read_state(s.loaded.sim()).positions[s.loaded.model->bodies[top].first_vertex].y != before);
  restart(s);
  for (std::size_t b = 0; b <= top; ++b) hide_body(s, b, true);
  const auto none = picture(Look::surface, 1);
  for (const Look look : {Look::tets, Look::graph}) CHECK(picture(look, 1) == none);
  for (std::size_t b = 0; b <= top; ++b) hide_body(s, b, false);
  for (std::size_t i = 0; i < whole.size(); ++i) CHECK(picture(std::get<0>(ways[i]), std::get<1>(ways[i])) == whole[i]);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("window: where it is slow, it says what would be faster") {
  GlTest gl;
  Session s;
  show_beam(s);
  s.playing = true;
  const auto said = [&] {
    const auto advice = faster_way(s);
    if (advice && !advice->words.empty()) CHECK_NOTHROW(lane_settings(s.loaded.sim().settings, advice->words, ""));
    return advice ? advice->said : "";
  };
  CHECK(said() == "");
  s.clock.factor = 0.9;
  CHECK(said() == "");
  s.clock.factor = 0.01;
  s.gl.software = true;
  CHECK(said() == "mode cpu-fast");
  Settings settings = s.loaded.sim().settings;
  settings.mode = "cpu-fast", settings.substeps = 20;
  change_settings(s, settings);
  CHECK(said() == "solver hard");
  settings.substeps = 5;
  change_settings(s, settings);
  CHECK(said() == "a smaller scene");
  s.clock.halvings = 5;
  s.clock.factor = 0.03;
  CHECK(said() == "");
}
