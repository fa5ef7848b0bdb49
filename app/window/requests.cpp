// What a user asks for, as the actions that it takes.
#include <algorithm>
#include <cmath>

#include "app/window/session.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

namespace fs = std::filesystem;

bool is_fixed(Session& s, std::uint32_t vertex) {
  const bool fixed = !(s.loaded.sim().model->inverse_masses[vertex] > 0);
  if (fixed) say(s, fmt::format("vertex {} is fixed by the scene", vertex));
  return fixed;
}

std::vector<Settings> settings_of_lanes(const Session& s) {
  std::vector<Settings> all;
  for (std::size_t lane = 0; lane < s.loaded.lanes.size(); ++lane) all.push_back(asked_settings(s, lane));
  return all;
}

// A soft body's second lane is a solver that converges, so that the first one's error is seen; else a lane is as the
// chosen one, to be changed.
std::string words_of_next_lane(const Session& s) {
  const Sim& own = s.loaded.sim();
  if (s.loaded.lanes.size() > 1 || !has_forces(own.settings)) return "";
  constexpr double few = 100;
  const bool slow = solver_mode(own.settings).leapfrog || explicit_substeps(*own.model, own.settings) > few;
  return slow && !solver_mode(own.settings).implicit ? "newton" : slow ? "mode=newton,iterations=16" : "mode=explicit";
}

}  // namespace

void restart(Session& s) {
  const Settings &made = s.loaded.scene.settings, &now = asked_settings(s);
  const auto made_with_another = [&](const Parameter& row) {
    return row.effect == Effect::restart && parameter_text(made, row) != parameter_text(now, row);
  };
  if (std::ranges::any_of(parameters(), made_with_another))
    load_soon(s, s.loaded.name, s.loaded.overrides, true, true);
  else
    emit(s, action::Reset{});
}

void go_back(Session& s) {
  between_steps(s, [&s] {
    let_go(s);
    if (!check_finite(s.loaded.sim(), true)) return say(s, "the state is finite again");
    perform(s, action::GoBack{});
  });
}

void change_speed(Session& s, int halvings) {
  halvings = std::clamp(halvings, 0, most_halvings);
  if (s.clock.halvings != halvings) emit(s, action::SetSpeed{halvings});
}

int halvings_for(double speed) {
  return std::clamp(int(std::lround(-std::log2(std::clamp(speed, 1e-3, 1.0)))), 0, most_halvings);
}

void change_settings(Session& s, const Settings& wanted) {
  const Settings& now = asked_settings(s);
  // Nothing ends a step early, so a slider does not go where one takes minutes.
  constexpr long most = 10000;
  const auto passes = [](const Settings& settings) {
    const Plan plan = plan_for(settings);
    return long(plan.iterations) * plan.substeps;
  };
  if (passes(wanted) > std::max(most, passes(now)))
    return say(
        s,
        fmt::format("the window takes at most {} substeps x iterations; a scene or the command line takes more", most));
  if (wanted != now) emit(s, action::Set{s.loaded.chosen, wanted});
}

void choose_body(Session& s, std::optional<std::size_t> body) {
  const auto& bodies = s.loaded.model->bodies;
  s.loaded.body = body;
  s.log("body {}", s.loaded.body ? bodies[*s.loaded.body].name : "all");
  say(s, s.loaded.body ? fmt::format("the panel is of {}", bodies[*s.loaded.body].name) : "the panel is of all bodies");
}

void choose_body_at_cursor(Session& s) {
  if (s.loaded.model->bodies.size() < 2) return;
  const auto& reading = s.loaded.probe.reading;
  choose_body(s, reading ? std::optional(body_at(*s.loaded.model, reading->vertex).number) : std::nullopt);
}

void add_lane(Session& s, const std::string& wanted) {
  between_steps(s, [&s, wanted] {
    if (s.loaded.lanes.size() >= most_lanes) return say(s, fmt::format("there are {} lanes: no more fit", most_lanes));
    const Sim& own = s.loaded.sim();
    const std::string words = wanted.empty() ? words_of_next_lane(s) : wanted;
    std::vector<Settings> lanes = settings_of_lanes(s);
    lanes.push_back(lane_settings(own.settings, words, "--lane " + words, own.model));
    perform(s, action::StartLanes{lanes});
    // The panel stays with what is compared with the solver that converges.
    if (!wanted.empty() || words.empty()) s.loaded.chosen = s.loaded.lanes.size() - 1;
    s.ui.hinted[2] = true;
  });
}

void remove_lane(Session& s, std::size_t lane) {
  between_steps(s, [&s, lane] {
    std::vector<Settings> lanes = settings_of_lanes(s);
    if (lanes.size() == 1 || lane >= lanes.size()) return;
    lanes.erase(lanes.begin() + std::ptrdiff_t(lane));
    emit(s, action::StartLanes{lanes});
  });
}

void compare_lanes(Session& s, const std::vector<std::string>& words) {
  between_steps(s, [&s, words] {
    action::StartLanes start;
    for (const std::string& own : words)
      start.lanes.push_back(lane_settings(s.loaded.scene.settings, own, "--lane " + own, s.loaded.model));
    if (words.empty()) start.lanes = {s.loaded.lanes.front().sim.settings};
    perform(s, start);
    s.loaded.chosen = 0;
  });
}

void choose_lane(Session& s, std::size_t lane) {
  if (lane >= s.loaded.lanes.size() || lane == s.loaded.chosen) return;
  let_go(s);
  s.loaded.chosen = lane;
  s.loaded.renderer.values_copied = {};
  s.log("lane {} chosen", lane + 1);
}

void toggle_pin(Session& s, std::uint32_t vertex) {
  if (is_fixed(s, vertex)) return;
  const bool pinned = is_pinned(s.loaded.sim(), vertex);
  emit(s, pinned ? Action(action::Unpin{vertex}) : action::Pin{vertex});
  s.ui.hinted[1] = true;
}

void catch_vertex(Session& s, const Pick& pick) {
  if (is_fixed(s, pick.vertex)) return;
  perform(s, action::Catch{pick.vertex, s.loaded.chosen, s.grab_radius});
  s.grab = begin_grab(s.loaded.sim(), *s.hold, pick);
  s.ui.hinted[0] = true;
  s.log("grab {}", pick.vertex);
}

void let_go(Session& s) {
  between_steps(s, [&s] {
    if (s.hold) perform(s, action::Release{});
  });
}

void choose_soon(Session& s) {
  s.task = Task{"trying ways to solve", [&s] {
                  Scene scene = s.loaded.scene;
                  scene.settings = s.loaded.sim().settings;
                  scene.budget_ms = s.budget_ms;
                  try {
                    s.loaded.choice = choose_for(scene, s.loaded.model, s.show_progress);
                  } catch (const Interrupted&) {
                    return say(s, "cancelled: the solver stays as it is");
                  }
                  change_settings(s, scene.settings);
                  say_choice(s);
                }};
}

void load_soon(Session& s, const std::string& name, const SceneOverrides& overrides, bool keep, bool keep_camera) {
  forget_errors(s);
  s.task = Task{"loading " + (overrides.mesh.empty() ? name : overrides.mesh.string()), [=, &s] {
                  std::vector<Settings> lanes = settings_of_lanes(s);
                  perform(s, action::OpenScene{name, overrides, keep ? std::optional(lanes[0]) : std::nullopt, keep,
                                               keep_camera});
                  const fs::path file = overrides.mesh.empty() ? fs::path(name) : overrides.mesh;
                  if (std::error_code error; fs::is_regular_file(file, error)) remember(s.ui.kept, file);
                  if (keep && lanes.size() > 1) perform(s, action::StartLanes{lanes});
                  s.changes = {};
                  // What was there before is gone.
                  s.log("live {} {}", gl_live().objects, gl_live().buffer_bytes);
                }};
}

void open_file(Session& s, const fs::path& file) {
  if (file.extension() == ".state") return void(emit(s, action::OpenState{file}));
  if (file.extension() == ".json") return load_soon(s, file.string(), {}, false, false);
  SceneOverrides overrides = s.loaded.overrides;
  overrides.mesh = file;
  load_soon(s, s.loaded.name, overrides, true, false);
}

}  // namespace tetpbd
