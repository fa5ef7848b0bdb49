// What the window does without a display: its panel's text, and a camera that follows.
#include <doctest/doctest.h>

#include <algorithm>
#include <thread>

#include "app/reference_command.h"
#include "app/run_loop.h"
#include "app/session.h"
#include "app/ui.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/material.h"
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
      draw(s.loaded.renderer, frame_of(s.loaded.sim(), s.camera, s.view, target));
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
  CHECK(lane_settings(own, "budget_ms=2", "--lane") == own);  // nothing to try it on
  for (const char* none : {"budget_ms=", "budget_ms=-1", "budget_ms=2ms", "budget_ms=inf"})
    CHECK_THROWS_WITH_AS(lane_settings(own, none, "--lane"), doctest::Contains("is no time"), Error);
  CHECK_THROWS_WITH_AS(lane_settings(own, "fast", "--lane fast"),
                       doctest::Contains("'fast' is no way to solve"), Error);
  CHECK_THROWS_WITH_AS(lane_settings(own, "mode=newton", "--lane"), doctest::Contains("needs forces"), Error);
  for (const Comparison& row : comparisons()) {
    CAPTURE(row.name);
    CHECK(row.lanes.size() <= most_lanes);
    Settings soft = own;
    apply_preset(soft, material_presets(), "rubber");
    for (const std::string& words : row.lanes) CHECK_NOTHROW(lane_settings(soft, words, row.name));
  }
}

TEST_CASE("window: lanes step together from a common start, and are held against the right motion") {
  GlTest gl;
  Session s;
  show_beam(s);
  single_step(s);
  compare_lanes(s, {"paper,substeps=1,iterations=1", "hard", "cpu-fast"});
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
  remove_lane(s);
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
    CHECK(double(apart[v]) ==
          doctest::Approx(glm::distance(state.positions[v], s.loaded.right->positions[std::size_t(kept)][v]) /
                          model.size)
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
  const double ratio =
      tet_volumes({state.positions, tet, {}})[0] / tet_volumes({model.rest.positions, tet, {}})[0];
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
  CHECK(patches.back() + 1 == float(sim.solver.iteration[0].work_groups));
  choose_colour(s, Colour::motion);
  toggle_pin(s, 0);  // no longer the scene's motion
  draw_lanes(s, target);
  CHECK_FALSE(s.loaded.lane().apart);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("window: a history is all of it in even steps, and the newest; plots are copied and saved") {
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
  CHECK(history.times[history.times.size() - 2] ==
        409);  // eight steps on from 400, of which each eighth is kept
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
  CHECK(to_svg(chart).find("distance from the right motion") != std::string::npos);
  const std::string csv = plot_csv(s, distance);
  CHECK(csv.starts_with("lane,time [s],distance from the right motion [%]\n\"node, 5 substeps\",0"));
  CHECK(std::ranges::count(csv, '\n') == 1 + 2 * std::ssize(chart.series[0].points));
  const Measurement now = measure_now(*s.loaded.lanes[0].metrics, s.loaded.lanes[0].sim);
  CHECK(double(s.loaded.lanes[0].energy.values.back()) == doctest::Approx(now.energy()).epsilon(0.2));
  restart(s);
  CHECK(plot_chart(s, distance).series.empty());
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
    for (long i = 1; i <= steps; ++i) {
      step(sim);
      if (i == steps || i % std::max(1l, steps / 16) == 0)
        add_state(error, *right, *sim.model, i, read_state(sim));
    }
    CHECK(cell.percent == doctest::Approx(100 * error.rms).epsilon(1e-6));
  }
  CHECK_FALSE(s.loaded.map->sim);  // done: it holds nothing
  // A material's right motion is found meanwhile; what a mode does not take is said.
  Settings soft = lane_settings(own, "foam,mode=explicit", "");
  soft.stability = 0.01;
  const auto cells = fill(soft, "young_modulus=1e5,1e12", "omega=1,1.5");
  CHECK(s.loaded.map->order == std::vector<std::size_t>{0, 2, 1, 3});
  CHECK(cells[0].state == MapCell::finished);
  CHECK(cells[0].percent < 0.1);
  CHECK(cells[1].state == MapCell::refused);
  CHECK(cells[1].why.find("too stiff") != std::string::npos);
  CHECK_THROWS_WITH_AS(start_map(s.loaded.sim().model, own, "mode=1,2", "dt=0.01", 1),
                       doctest::Contains("is no setting with a number"), Error);
  s.loaded.map = start_map(s.loaded.sim().model, soft, "young_modulus=1e5,1e6", "damping=0,1", 5);
  fill_map(s);  // and left while its motion is being found
  s.loaded.map.reset();
  CHECK(gl_error_count() == 0);
}
