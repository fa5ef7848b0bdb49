#include "app/window/action.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "app/bodies.h"
#include "app/files.h"
#include "app/obstacles.h"
#include "app/window/session.h"
#include "sim/error.h"
#include "sim/state_file.h"

namespace tetpbd {

namespace {

using namespace action;

bool differs(const Settings& a, const Settings& b, const Parameter& row) {
  return parameter_text(a, row) != parameter_text(b, row);
}

// ------------------------------------------------------------------------------------------------------------
// the whole

void act(Session& s, const OpenScene& a) {
  Scene scene = load_scene(a.name, a.overrides);
  if (a.settings) scene.settings = *a.settings, scene.mode_open = false, scene.budget_ms.reset();
  if (a.keep) scene.obstacles = s.loaded.scene.obstacles;
  Loaded loaded = load(a.name, a.overrides, std::move(scene));
  if (a.keep) loaded.own = s.loaded.own;
  take_over(s, std::move(loaded), a.keep_camera);
  if (a.keep) note(s, SetObstacles{s.loaded.scene.obstacles});
}

void act(Session& s, const Reset&) {
  for (Lane& lane : s.loaded.lanes) reset(lane.sim);
  find_right(s);
  start_afresh(s);
  begin_timeline(s);
  s.log("reset");
}

void act(Session& s, const StartLanes& a) {
  std::vector<Lane>& old = s.loaded.lanes;
  std::vector<std::size_t> from;  // the lane of now that goes on as such, or one past the last
  std::vector<Lane> made;
  for (const Settings& wanted : a.lanes) {
    std::size_t i = 0;
    while (i < old.size() && (std::ranges::count(from, i) || old[i].sim.settings != wanted)) ++i;
    from.push_back(i);
    if (i == old.size()) made.push_back({create_sim(s.loaded.model, wanted)});
  }
  std::vector<Lane> lanes;
  auto next = made.begin();
  for (const std::size_t i : from) lanes.push_back(std::move(i < old.size() ? old[i] : *next++));
  old = std::move(lanes);
  s.loaded.chosen = std::min(s.loaded.chosen, old.size() - 1);
  act(s, Reset{});
  for (const Lane& lane : old) s.log("lane {}", describe(lane));
}

void act(Session& s, const OpenState& a) {
  bool all = true;
  for (Lane& lane : s.loaded.lanes) all &= load_state(lane.sim, a.file);
  play(s, false);
  disturb(s), start_afresh(s), begin_timeline(s);
  s.log("state of {}", s.loaded.lane().steps());
  say(s, fmt::format("{}: {}", a.file.filename().string(),
                     all ? "goes on from there" : "other settings, so positions and velocities alone"));
}

void act(Session& s, const GoBack&) {
  if (!restore_checkpoint(s.loaded.sim())) return say(s, "no good state is kept: reset (R)");
  start_afresh(s);
  s.log("back {}", s.loaded.lane().steps());
}

// ------------------------------------------------------------------------------------------------------------
// settings and obstacles

void put_settings(Session& s, std::size_t number, const Settings& wanted) {
  auto& lanes = s.loaded.lanes;
  Lane& lane = lanes[number];
  const Settings old = lane.sim.settings;
  const bool alone = lanes.size() == 1 && !s.loaded.right;
  const std::uint64_t before = alone ? 0 : motion_key(lane);
  apply_settings(lane.sim, wanted);
  lane.patches = {}, lane.ledger = {};
  if (alone ? lane.sim.steps > 0 : motion_key(lane) != before) disturb(s);
  if (!alone)
    s.loaded.comparable =
        std::ranges::all_of(lanes, [&](const Lane& other) { return motion_key(other) == motion_key(lane); });
  for (const Parameter& row : parameters())
    if (row.effect == Effect::rebuild && differs(wanted, old, row)) lane.step_ms = {};
}

void log_settings(Session& s, const Settings& old, const Settings& now) {
  for (const Parameter& row : parameters()) {
    if (!differs(now, old, row)) continue;
    s.log("set {} {}", row.name, parameter_text(now, row));
    if (row.effect == Effect::restart) say(s, fmt::format("{} takes effect at the next reset (R)", row.name));
  }
  for (std::size_t b = 0; b < now.bodies.size(); ++b)
    if (b >= old.bodies.size() || now.bodies[b] != old.bodies[b])
      s.log("set body {} {}", b, json_text(body_settings_json(now.bodies[b]), -1));
}

void act(Session& s, const Set& a) {
  auto& lanes = s.loaded.lanes;
  const Settings old = lanes[a.lane].sim.settings;
  std::vector<Settings> wanted;  // of all lanes, before any is changed
  for (const Lane& lane : lanes) wanted.push_back(lane.sim.settings);
  wanted[a.lane] = a.settings;
  for (Settings& own : wanted) {
    for (const Parameter& row : parameters())
      if (shared_by_lanes(row) && differs(a.settings, old, row))
        set_parameter(own, row, parameter_text(a.settings, row), row.name);
    check_settings(own, "settings");
  }
  for (std::size_t i = 0; i < lanes.size(); ++i)
    if (wanted[i] != lanes[i].sim.settings) put_settings(s, i, wanted[i]);
  forget_errors(s);  // such as that of a setting that did not go with the others
  log_settings(s, old, a.settings);
}

// Of all lanes. What still reads the model of before, as the map's thread does, goes on with that.
void adopt_model(Session& s, const std::shared_ptr<const Model>& model) {
  const bool same_kernels = share_kernels(*s.loaded.model, *model);
  s.loaded.model = model;
  for (Lane& lane : s.loaded.lanes) {
    change_obstacles(lane.sim, model);
    if (!same_kernels) lane.metrics.reset();
  }
}

void act(Session& s, const SetObstacles& a) {
  std::vector<Obstacle> wanted = a.obstacles;
  for (Obstacle& o : wanted)
    if (!o.field) load_field(o);
  const auto old_model = s.loaded.model;
  auto model = std::make_shared<Model>(*old_model);
  model->obstacles = wanted;
  try {
    adopt_model(s, model);
  } catch (...) {
    adopt_model(s, old_model);
    throw;
  }
  disturb(s);
  const std::vector<Obstacle> before = std::exchange(s.loaded.scene.obstacles, std::move(wanted));
  const auto& now = s.loaded.scene.obstacles;
  s.obstacle = std::min(s.obstacle, int(now.size()) - 1);
  if (now.size() != before.size()) return s.log("obstacles {}", now.size());
  const auto move_alike = [](const Obstacle& x, const Obstacle& y) {
    return x.velocity == y.velocity && x.spin == y.spin && x.keyframes.empty() == y.keyframes.empty();
  };
  if (std::ranges::equal(now, before, move_alike)) return;
  let_go(s);
  act(s, Reset{});
}

// ------------------------------------------------------------------------------------------------------------
// vertices

void act(Session& s, const Catch& a) {
  disturb(s);
  s.timeline.looping = false;
  s.hold = take_hold(s.loaded.lanes[a.lane].sim, a.vertex, a.radius);
  s.timeline.touched.insert(s.hold->vertices.begin(), s.hold->vertices.end());
  for (Lane& lane : s.loaded.lanes) pin_held(lane.sim, *s.hold);
}

void act(Session& s, const Lead& a) {
  const bool held = s.hold && s.hold->caught() == a.vertex;
  for (Lane& lane : s.loaded.lanes) held ? move_held(lane.sim, *s.hold, a.to) : move_pinned(lane.sim, a.vertex, a.to);
}

void act(Session& s, const Release&) {
  for (Lane& lane : s.loaded.lanes) unpin_held(lane.sim, *s.hold);
  if (s.grab) s.log("release {} moved {:.4f}", s.hold->caught(), glm::length(s.grab->position - s.grab->start));
  s.grab.reset(), s.hold.reset();
}

void set_pinned(Session& s, std::uint32_t vertex, bool pinned) {
  disturb(s);
  s.timeline.looping = false;
  s.timeline.touched.insert(vertex);
  for (Lane& lane : s.loaded.lanes) pinned ? pin(lane.sim, vertex) : unpin(lane.sim, vertex);
  s.log("{} {}", pinned ? "pin" : "unpin", vertex);
}
void act(Session& s, const Pin& a) { set_pinned(s, a.vertex, true); }
void act(Session& s, const Unpin& a) { set_pinned(s, a.vertex, false); }

// ------------------------------------------------------------------------------------------------------------
// time and view

void act(Session& s, const Go& a) { show_step(s, a.step); }

void act(Session& s, const SetSpeed& a) {
  s.clock.halvings = a.halvings;
  s.clock.owed = 0;
  s.log("speed {}", s.clock.speed());
}

void act(Session& s, const SetView& a) {
  if (a.view.colour != s.view.colour) choose_colour(s, a.view.colour);
  s.view = a.view;
  s.fit_range = false;
  s.overlaid = a.overlaid, s.ghost = a.ghost;
}

void act(Session& s, const SetCamera& a) { s.camera = a.camera; }

// ------------------------------------------------------------------------------------------------------------
// undo

template <class... T>
bool is_one_of(const Action& action) {
  return (std::holds_alternative<T>(action) || ...);
}

bool touches_lanes(const Action& action) { return !is_one_of<Lead, SetSpeed, SetView, SetCamera>(action); }

Made what_is_made(const Session& s) {
  Made made{{}, s.loaded.scene.obstacles, {}};
  for (const Lane& lane : s.loaded.lanes) made.lanes.push_back(lane.sim.settings);
  for (const std::uint32_t v : s.timeline.touched)
    if (is_pinned(s.loaded.sim(), v) && !(s.hold && !s.hold->was_pinned && s.hold->has(v))) made.pins.push_back(v);
  return made;
}

bool same_obstacles(const Made& a, const Made& b) {
  return std::ranges::equal(a.obstacles, b.obstacles, {}, obstacle_values, obstacle_values);
}

void keep_change(Session& s, Made before) {
  auto& [past, future, open, paused] = s.changes;
  Made now = what_is_made(s);
  if (now.lanes == before.lanes && now.pins == before.pins && same_obstacles(now, before)) return;
  future.clear();
  if (std::exchange(open, true) && !past.empty()) {
    past.back().after = std::move(now);
    return;
  }
  past.push_back({std::move(before), std::move(now)});
  if (constexpr std::size_t most_kept = 200; past.size() > most_kept) past.erase(past.begin());
}

// Of what differs between the two alone: what else was done in the meantime stays.
void bring_back(Session& s, const Made& from, const Made& to) {
  if (from.lanes.size() != to.lanes.size()) {
    perform(s, StartLanes{to.lanes});
  } else {
    for (std::size_t i = 0; i < to.lanes.size(); ++i)
      if (from.lanes[i] != to.lanes[i]) perform(s, Set{i, to.lanes[i]});
  }
  if (!same_obstacles(from, to)) perform(s, SetObstacles{to.obstacles});
  for (const std::uint32_t v : to.pins)
    if (!std::ranges::count(from.pins, v)) perform(s, Pin{v});
  for (const std::uint32_t v : from.pins)
    if (!std::ranges::count(to.pins, v)) perform(s, Unpin{v});
}

void take_back(Session& s, const char* word, bool forward) {
  auto& from = forward ? s.changes.future : s.changes.past;
  auto& to = forward ? s.changes.past : s.changes.future;
  if (from.empty()) return say(s, fmt::format("nothing to {}", word));
  let_go(s);
  s.log("{}", word);
  const Change change = from.back();
  from.pop_back();
  s.changes.paused = true;
  const bool done = attempt(
      s, [&] { forward ? bring_back(s, change.before, change.after) : bring_back(s, change.after, change.before); });
  s.changes.paused = s.changes.open = false;
  if (done) to.push_back(change);
}

}  // namespace

void undo(Session& s) {
  between_steps(s, [&s] { take_back(s, "undo", false); });
}
void redo(Session& s) {
  between_steps(s, [&s] { take_back(s, "redo", true); });
}

void perform(Session& s, const Action& action) {
  if (touches_lanes(action)) finish_step(s);
  if (is_one_of<OpenScene, Reset, StartLanes, OpenState, GoBack, Go>(action)) let_go(s);
  note_moment(s);
  const auto line = line_of(s, action);
  const bool edits = is_one_of<StartLanes, Set, SetObstacles, Pin, Unpin>(action) && !s.changes.paused;
  const auto before = edits ? std::optional(what_is_made(s)) : std::nullopt;
  std::visit([&](const auto& a) { act(s, a); }, action);
  if (line) write(s, *line);
  if (before) {
    const bool at_once = !is_one_of<Set, SetObstacles>(action);  // no slider is held meanwhile
    if (at_once) s.changes.open = false;
    keep_change(s, *before);
    if (at_once) s.changes.open = false;
  }
  if (!is_one_of<Go>(action)) note_step(s);
}

// A slider that is held says many times what shall be: of these the last counts.
static bool replaces(const Action& next, const Action& last) {
  if (const auto* set = std::get_if<Set>(&next))
    return std::holds_alternative<Set>(last) && std::get<Set>(last).lane == set->lane;
  return is_one_of<SetObstacles>(next) && is_one_of<SetObstacles>(last);
}

void emit(Session& s, const Action& action) {
  if (!s.under_way || !touches_lanes(action)) return void(attempt(s, [&] { perform(s, action); }));
  if (is_one_of<Reset>(action) && s.waiting.empty()) give_up_step(s);
  if (!s.waiting.empty() && s.waiting.back().action && replaces(action, *s.waiting.back().action)) s.waiting.pop_back();
  s.waiting.push_back({[&s, action] { perform(s, action); }, action});
}

}  // namespace tetpbd
