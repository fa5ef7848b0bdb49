#include "app/window/session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <new>
#include <nlohmann/json.hpp>
#include <utility>

#include "app/bodies.h"
#include "app/files.h"
#include "app/lab/reference_command.h"
#include "app/lab/run.h"
#include "app/lab/verdict.h"
#include "app/window/edit_obstacles.h"
#include "sim/contact/starts.h"
#include "sim/error.h"
#include "sim/model/material.h"
#include "sim/state_file.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

using Steady = std::chrono::steady_clock;

// After the state was put back: measurements under way belong to what was before.
void start_afresh(Session& s) {
  s.clock.owed = 0;
  s.messages.clear();
  for (Lane& lane : s.loaded.lanes) {
    while (lane.metrics && collect(*lane.metrics, true)) {
    }
    lane.step_ms = lane.volume_error = lane.energy = lane.distance = lane.depth = lane.created = {};
    lane.ledger = {}, lane.gain_said = false;
    lane.apart = {};
  }
  s.loaded.disturbed = false;
  s.loaded.held = -1;
}

bool differs(const Settings& a, const Settings& b, const Parameter& row) {
  return parameter_text(a, row) != parameter_text(b, row);
}

void say_choice(Session& s) {
  s.budget_ms = s.loaded.choice->budget_ms;
  say(s, "solver: " + describe(*s.loaded.choice));
}

std::uint64_t key_of(const Lane& lane) { return scene_key(*lane.sim.model, lane.sim.settings); }

// What lanes are held against, if one answer is right for all; found again only where it is another.
void find_right(Session& s) {
  const auto& lanes = s.loaded.lanes;
  auto& right = s.loaded.right;
  if (lanes.size() == 1 && s.view.colour != Colour::motion) return right.reset();
  const Sim& first = lanes[0].sim;
  const std::uint64_t key = key_of(lanes[0]);
  s.loaded.comparable = std::ranges::all_of(lanes, [&](const Lane& lane) { return key_of(lane) == key; });
  const long steps = std::max(1l, std::lround(s.loaded.scene.duration / first.settings.dt));
  if (!s.loaded.comparable) return right.reset();
  if (right && right->scene == key && right->kept.back() >= steps) return;
  right = right_motion(*first.model, first.settings);
  if (!right) right = rigid_motion(*first.model, first.settings, steps);
}

bool is_fixed(Session& s, std::uint32_t vertex) {
  const bool fixed = !(s.loaded.sim().model->inverse_masses[vertex] > 0);
  if (fixed) say(s, fmt::format("vertex {} is fixed by the scene", vertex));
  return fixed;
}

void put_settings(Session& s, const std::vector<Settings>& of_lanes) {
  finish_step(s);
  const Settings old = s.loaded.sim().settings;
  for (std::size_t i = 0; i < of_lanes.size(); ++i) {
    Lane& lane = s.loaded.lanes[i];
    if (of_lanes[i] == lane.sim.settings) continue;
    const bool alone = of_lanes.size() == 1 && !s.loaded.right;
    const std::uint64_t before = alone ? 0 : key_of(lane);  // it reads the whole mesh
    const Settings own = lane.sim.settings;
    apply_settings(lane.sim, of_lanes[i]);
    note(s, {{"lane", i}, {"set", settings_text(of_lanes[i], &own)}});
    lane.patches = {}, lane.ledger = {};
    if (alone && lane.sim.steps > 0) disturb(s);
    if (alone || key_of(lane) == before) continue;
    disturb(s);
    s.loaded.comparable =
        std::ranges::all_of(s.loaded.lanes, [&](const Lane& other) { return key_of(other) == key_of(lane); });
  }
  forget_errors(s);  // such as that of a setting that did not go with the others
  for (const Parameter& row : parameters()) {
    const Settings& now = s.loaded.sim().settings;
    if (!differs(now, old, row)) continue;
    s.log("set {} {}", row.name, parameter_text(now, row));
    if (row.effect == Effect::restart) say(s, fmt::format("{} takes effect at the next reset (R)", row.name));
    if (row.effect == Effect::rebuild) s.loaded.lane().step_ms = {};
  }
  const auto& now = s.loaded.sim().settings.bodies;
  for (std::size_t b = 0; b < now.size(); ++b)
    if (b >= old.bodies.size() || now[b] != old.bodies[b])
      s.log("set body {} {}", b, json_text(body_settings_json(now[b]), -1));
}

void take_back(Session& s, const char* word, std::vector<Change>& from, std::vector<Change>& to) {
  if (from.empty()) return say(s, fmt::format("nothing to {}", word));
  s.log("{}", word);
  const Change now = settings_and_obstacles(s);
  const bool done = attempt(s, [&] {
    put_settings(s, from.back().lanes);
    const auto numbers = [](const std::vector<Obstacle>& all) {
      std::vector<std::vector<double>> list;
      for (const Obstacle& o : all) list.push_back(obstacle_values(o));
      return list;
    };
    if (numbers(now.obstacles) != numbers(from.back().obstacles)) put_obstacles(s, from.back().obstacles);
  });
  if (done) to.push_back(now);
  from.pop_back();
  s.changes.open = false;
}

}  // namespace

void disturb(Session& s) {
  if (!std::exchange(s.loaded.disturbed, true))
    for (Lane& lane : s.loaded.lanes) lane.distance = {}, lane.apart = {};
  for (Lane& lane : s.loaded.lanes) lane.ledger = {};
}

void forget_errors(Session& s) {
  std::erase_if(s.messages,
                [](const Message& m) { return m.error && !m.non_finite && !m.text.starts_with("shader "); });
}

static void begin_step(Session& s) {
  s.under_way.emplace();
  if (s.grab) {
    lead(*s.grab);
    const glm::dvec3& to = s.grab->position;
    note(s, {{"move", {s.hold->caught(), to.x, to.y, to.z}}});
  }
  note_moment(s);
}

static void end_step(Session& s) {
  auto& lanes = s.loaded.lanes;
  s.step_seconds = s.under_way->seconds;
  s.under_way.reset();
  if (s.loaded.right && !s.loaded.disturbed && s.loaded.sim().steps > s.loaded.right->kept.back()) disturb(s);
  if ((lanes.size() > 1 && s.loaded.comparable) || right_now(s)) hold_lanes(lanes, right_now(s));
  if (right_now(s)) hold_vertices(s);  // of few steps the reference motion is kept
  s.clock.simulated += s.loaded.sim().settings.dt;
  keep_moment(s);
  note_step(s);
}

bool step_lanes(Session& s, double seconds) {
  const auto begin = Steady::now();
  if (!s.under_way) begin_step(s);
  const auto enough = [&] { return seconds_since(begin) > seconds; };
  for (auto& [number, whole, of_lane] = *s.under_way; number < s.loaded.lanes.size(); ++number, of_lane = 0) {
    Lane& lane = s.loaded.lanes[number];
    const bool begins = lane.sim.substeps_done == 0;
    if (begins && s.loaded.lanes.size() > 1 && check_finite(lane.sim)) continue;
    if (begins && s.grab) move_held(lane.sim, *s.hold, s.grab->position);
    const bool in_parts = std::isfinite(seconds);  // a timer of the driver would time what is drawn in between
    if (in_parts) lane.sim.timed = false;
    const auto part = Steady::now();
    const bool ended = step_until(lane.sim, enough);
    whole += seconds_since(part), of_lane += seconds_since(part);
    if (!ended) return false;
    if ((on_cpu(lane.sim) || in_parts) && s.measuring) lane.step_ms.add(of_lane * 1e3, simulated_time(lane.sim));
    if (number + 1 < s.loaded.lanes.size() && enough()) return ++number, of_lane = 0, false;
  }
  end_step(s);
  return true;
}

void step_lanes(Session& s) {
  while (!step_lanes(s, std::numeric_limits<double>::infinity())) {
  }
}

void finish_step(Session& s) {
  if (s.under_way) step_lanes(s);
}

void log_state(Session& s) {
  if (!s.log.file.is_open()) return;
  for (std::size_t i = 0; s.loaded.lanes.size() > 1 && i < s.loaded.lanes.size(); ++i) {
    const Sim& sim = s.loaded.lanes[i].sim;
    s.log("lane {} {} {} {:016x}", i + 1, sim.settings.mode, sim.steps, state_hash(sim));
  }
  s.log("state {} {:016x}", s.loaded.sim().steps, state_hash(s.loaded.sim()));
}

Loaded load(const std::string& name, const SceneOverrides& overrides, Scene scene) {
  const auto model = build_model(scene);
  if (const auto rule = choose_by_rule(scene, *model)) fmt::print("solver: {}\n", *rule);
  auto choice = choose_for(scene, model);
  Loaded loaded{name, overrides, scene, scene.settings, model, {}, {}, {}, choice};
  loaded.scene.obstacles = model->obstacles;  // with their fields
  loaded.lanes.push_back({create_sim(model, scene.settings)});
  loaded.renderer = make_renderer(*model);
  loaded.picker = make_picker(model->rest);
  if (!model->rest.tets.empty()) loaded.flattest = flattest_tet(model->rest);
  return loaded;
}

void say(Session& s, const std::string& text, bool error, bool non_finite) {
  s.log("{} {}", error ? "error" : "message", text);
  std::erase_if(s.messages, [&](const Message& m) { return m.text == text; });
  constexpr std::size_t most = 5;  // what a small window has room for
  if (s.messages.size() >= most) s.messages.erase(s.messages.begin());
  s.messages.push_back({text, error, non_finite, s.now});
}

bool attempt(Session& s, const std::function<void()>& action) {
  try {
    action();
    return true;
  } catch (const ContextLost&) {
    throw;  // nothing that could be shown is left
  } catch (const std::bad_alloc&) {
    say(s, "out of memory: use a smaller mesh", true);
  } catch (const std::exception& error) {
    say(s, error.what(), true);
  }
  return false;
}

void play(Session& s, bool playing) {
  if (s.playing == playing) return;
  if (!playing) attempt(s, [&] { finish_step(s); });
  s.playing = playing;
  s.clock.owed = 0;
  s.log("{}", playing ? "play" : "pause");
  if (!playing) log_state(s);
}

void single_step(Session& s) {
  play(s, false);
  s.timeline.looping = false;
  attempt(s, [&] {
    step_lanes(s);
    measure_frame(s, true);
  });
  s.log("step {}", s.loaded.sim().steps);
  log_state(s);
}

void change_speed(Session& s, int halvings) {
  if (s.clock.halvings == std::clamp(halvings, 0, most_halvings)) return;
  s.clock.halvings = std::clamp(halvings, 0, most_halvings);
  s.clock.owed = 0;
  note(s, {{"speed", s.clock.speed()}});
  s.log("speed {}", s.clock.speed());
}

void restart(Session& s) {
  let_go(s);
  s.under_way.reset();  // reset() drops it
  const auto made_with_another = [&](const Parameter& row) {
    return row.effect == Effect::restart && differs(s.loaded.scene.settings, s.loaded.sim().settings, row);
  };
  if (std::ranges::any_of(parameters(), made_with_another))
    return load_soon(s, s.loaded.name, s.loaded.overrides, true, true);
  note(s, {{"reset", true}});
  attempt(s, [&] {
    for (Lane& lane : s.loaded.lanes) reset(lane.sim);
    find_right(s);
  });
  start_afresh(s);
  begin_timeline(s);
  s.log("reset");
}

void go_back(Session& s) {
  finish_step(s);
  let_go(s);
  attempt(s, [&] {
    if (!check_finite(s.loaded.sim(), true)) return say(s, "the state is finite again");
    note(s, {{"back", true}});
    if (!restore_checkpoint(s.loaded.sim())) return say(s, "no good state is kept: reset (R)");
    start_afresh(s);
    note_step(s);
    s.log("back {}", s.loaded.sim().steps);
  });
}

void watch_state(Session& s) {
  if (s.loaded.lanes.size() > 1) return;  // that lane stops, and says so in its picture
  const auto& found = check_finite(s.loaded.sim());
  if (!found || (!s.playing && std::ranges::any_of(s.messages, &Message::non_finite))) return;
  let_go(s);
  play(s, false);
  forget_from(s, found->step);
  say(s, error_of(*found).what(), true, true);
}

Change settings_and_obstacles(const Session& s) {
  Change now{{}, s.loaded.scene.obstacles};
  for (const Lane& lane : s.loaded.lanes) now.lanes.push_back(lane.sim.settings);
  return now;
}

void keep_change(Session& s, const Change& before) {
  auto& [past, future, open] = s.changes;
  if (!std::exchange(open, true)) past.push_back(before);
  if (constexpr std::size_t most_kept = 200; past.size() > most_kept) past.erase(past.begin());
  future.clear();
}

void change_settings(Session& s, const Settings& wanted) {
  const Settings old = s.loaded.sim().settings;
  // Nothing ends a step early, so a slider does not go where one takes minutes.
  constexpr long most = 10000;
  const auto passes = [](const Settings& settings) {
    const Plan plan = plan_for(settings);
    return long(plan.iterations) * plan.substeps;
  };
  if (passes(wanted) > std::max(most, passes(old)))
    return say(s, fmt::format("iterations x substeps go to {} here; a scene or the command line can say more", most));
  attempt(s, [&] {
    // Of all lanes, before any is changed.
    const Change before = settings_and_obstacles(s);
    std::vector<Settings> of_lanes = before.lanes;
    of_lanes[s.loaded.chosen] = wanted;
    for (Settings& own : of_lanes) {
      for (const Parameter& row : parameters())
        if (shared_by_lanes(row) && differs(wanted, old, row))
          set_parameter(own, row, parameter_text(wanted, row), row.name);
      check_settings(own, "settings");
    }
    if (of_lanes == before.lanes) return;
    put_settings(s, of_lanes);
    keep_change(s, before);
  });
}

void choose_body(Session& s) {
  const auto& bodies = s.loaded.model->bodies;
  if (bodies.size() < 2) return;
  const auto& reading = s.loaded.probe.reading;
  s.loaded.body = reading ? std::optional(body_at(*s.loaded.model, reading->vertex).number) : std::nullopt;
  s.log("body {}", s.loaded.body ? bodies[*s.loaded.body].name : "all");
  say(s, s.loaded.body ? fmt::format("the panel is of {}", bodies[*s.loaded.body].name) : "the panel is of all bodies");
}

void undo(Session& s) { take_back(s, "undo", s.changes.past, s.changes.future); }
void redo(Session& s) { take_back(s, "redo", s.changes.future, s.changes.past); }

void choose_soon(Session& s) {
  s.task = Task{"trying ways to solve", [&s] {
                  Scene scene = s.loaded.scene;
                  scene.settings = s.loaded.sim().settings;
                  scene.budget_ms = s.budget_ms;
                  s.loaded.choice = choose_for(scene, s.loaded.sim().model);
                  change_settings(s, scene.settings);
                  say_choice(s);
                }};
}

void take_over(Session& s, Loaded loaded, bool keep_camera) {
  s.grab.reset(), s.hold.reset();
  s.under_way.reset();
  s.changes = {};
  s.obstacle = -1;
  s.loaded = std::move(loaded);
  if (all_have_own_materials(s.loaded.sim().settings)) s.loaded.body = 0;
  note_scene(s);
  if (!keep_camera) {
    s.camera = scene_camera(s.loaded.scene, *s.loaded.sim().model, s.aspect);
    s.beside = glm::vec3(0);
  }
  s.centre.reset();
  s.worst.clear();
  start_afresh(s);
  if (s.view.colour == Colour::motion) attempt(s, [&] { find_right(s); });
  begin_timeline(s);
  s.log("scene {} {} vertices", s.loaded.name, s.loaded.sim().model->positions.size());
  if (s.loaded.choice) say_choice(s);
  for (const StartMotion& motion : s.loaded.sim().model->start_motions) say(s, describe(motion));
}

void load_soon(Session& s, const std::string& name, const SceneOverrides& overrides, bool keep_settings,
               bool keep_camera) {
  forget_errors(s);
  s.task = Task{"loading " + (overrides.mesh.empty() ? name : overrides.mesh.string()), [=, &s] {
                  Scene scene = load_scene(name, overrides);
                  std::vector<Settings> others;  // of further lanes, which start anew as well
                  if (keep_settings) {
                    for (const Lane& lane : s.loaded.lanes) others.push_back(lane.sim.settings);
                    scene.settings = others.front();
                    others.erase(others.begin());
                    scene.mode_open = false, scene.budget_ms.reset();
                    scene.obstacles = s.loaded.scene.obstacles;
                  }
                  Loaded loaded = load(name, overrides, scene);
                  if (keep_settings) loaded.own = s.loaded.own;
                  take_over(s, std::move(loaded), keep_camera);
                  if (keep_settings && s.record) put_obstacles(s, s.loaded.scene.obstacles), s.loaded.disturbed = false;
                  const fs::path file = overrides.mesh.empty() ? fs::path(name) : overrides.mesh;
                  if (std::error_code error; fs::is_regular_file(file, error)) remember(s.ui.kept, file);
                  for (const Settings& own : others) s.loaded.lanes.push_back({create_sim(s.loaded.sim().model, own)});
                  if (!others.empty()) start_lanes(s);
                  // What was there before is gone.
                  s.log("live {} {}", gl_live().objects, gl_live().buffer_bytes);
                }};
}

namespace {

// What a file may be called by that keeps something of a scene.
std::string file_stem(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return !std::isalnum(c) && c != '-'; }, '_');
  return name;
}

}  // namespace

void save_state_file(Session& s) {
  finish_step(s);
  attempt(s, [&] {
    const fs::path file = free_name(file_stem(s.loaded.scene.name), "state");
    save_state(s.loaded.sim(), file);
    say(s, fmt::format("saved {}: open it here, or tetpbd run --from-state {}", file.string(), file.string()));
  });
}

void open_state(Session& s, const fs::path& file) {
  finish_step(s);
  let_go(s);
  attempt(s, [&] {
    bool all = true;
    for (Lane& lane : s.loaded.lanes) all &= load_state(lane.sim, file);
    play(s, false);
    disturb(s), start_afresh(s), begin_timeline(s);
    note(s, {{"state", fs::absolute(file).string()}});
    s.log("state of {}", s.loaded.sim().steps);
    say(s, fmt::format("{}: {}", file.filename().string(),
                       all ? "goes on from there" : "other settings, so positions and velocities alone"));
  });
}

void open_file(Session& s, const fs::path& file) {
  if (file.extension() == ".state") return open_state(s, file);
  if (file.extension() == ".json") return load_soon(s, file.string(), {}, false, false);
  SceneOverrides overrides = s.loaded.overrides;
  overrides.mesh = file;
  load_soon(s, s.loaded.name, overrides, true, false);
}

void save_scene(Session& s) {
  attempt(s, [&] {
    const Model& model = *s.loaded.sim().model;
    Scene scene = s.loaded.scene;
    scene.settings = s.loaded.sim().settings;
    scene.camera = s.camera;
    if (s.view.follow && s.centre)  // seen from where it starts
      scene.camera->target += glm::vec3(bounds(model.positions).centre()) - *s.centre;
    const fs::path file = free_name(file_stem(scene.name), "json");
    write_file(file, json_text(scene_json(scene), 2) + "\n");
    const Target target = make_target(picture_width, picture_height, 4);
    const ViewOptions view = std::exchange(s.view, s.first_view);
    s.view.follow = s.view.legend = false;
    draw_lanes(s, target);
    s.view = view;
    write_png(fs::path(file).replace_extension("png"), read_rgba(target));
    remember(s.ui.kept, file);
    say(s, fmt::format("saved {0}: tetpbd --scene {0} opens it", file.string()));
  });
}

bool has_colour(const Session& s, Colour colour) {
  if (colour == Colour::patch) return has_patches(s.loaded.lanes[s.loaded.chosen]);
  const Settings& now = s.loaded.sim().settings;
  if (colour == Colour::residual) return !any_material(now, compliant);
  return colour != Colour::energy ||
         (any_material(now, has_energy) && !any_material(now, yields) && s.loaded.model->regions.empty());
}

void choose_colour(Session& s, Colour colour) {
  s.view.colour = colour;
  s.log("colour {}", colour_names[std::size_t(colour)]);
  s.worst.clear();
  s.loaded.renderer.values_copied = {};  // of another colour
  s.fit_range = colour == Colour::energy || colour == Colour::motion;
  s.fitted = -1;
  if (!has_colour(s, colour))
    say(s, colour == Colour::energy     ? "this needs a material"
           : colour == Colour::residual ? "constraints with compliance give way as they should: energy shows how far"
                                        : "patches of vertices are those of mode node");
  if (colour != Colour::motion) return;
  attempt(s, [&] { find_right(s); });
  if (s.loaded.disturbed)
    say(s, "no reference after your change: R compares again");
  else if (!s.loaded.right && s.loaded.lanes.size() == 1)
    say(s, "no reference motion is known: tetpbd reference finds it, or hold lanes against each other (K)");
}

void find_worst(Session& s) {
  if (!s.view.hold_range && s.view.colour != Colour::plain && s.now - s.fitted > 0.25)
    s.fit_range = true, s.fitted = s.now;
  std::optional<std::vector<float>> values;
  attempt(s, [&] { values = poll_values(s.loaded.renderer); });
  if (!values) return;
  const auto& places = s.loaded.renderer.mesh.positions;
  const auto size = [&](std::uint32_t v) { return std::isfinite((*values)[v]) ? std::abs((*values)[v]) : -1.0f; };
  constexpr std::size_t most = 5, looked_at = 4096;
  std::vector<std::uint32_t> order(values->size());
  for (std::uint32_t v = 0; v < order.size(); ++v) order[v] = v;
  const auto end = order.begin() + std::ptrdiff_t(std::min(order.size(), looked_at));
  std::ranges::partial_sort(order, end, std::ranges::greater(), size);
  s.worst.clear();
  for (auto v = order.begin(); v != end && s.worst.size() < most && size(*v) > 0; ++v) {
    const auto close = [&](const auto& other) {
      return glm::distance(places[other.first], places[*v]) < 0.06 * s.loaded.sim().model->size;
    };
    if (std::ranges::none_of(s.worst, close)) s.worst.emplace_back(*v, (*values)[*v]);
  }
  if (!std::exchange(s.fit_range, false)) return;
  const ColourRange fitted = fitted_range(s.view.scale(), std::move(*values));
  // What swings shall not take its scale along.
  if (fitted.high > s.view.range().high || fitted.high < 0.3 * s.view.range().high) s.view.range() = fitted;
}

const Motion* right_now(const Session& s) { return s.loaded.right && !s.loaded.disturbed ? &*s.loaded.right : nullptr; }

void hold_vertices(Session& s) {
  Loaded& l = s.loaded;
  const bool known = right_now(s) || (l.lanes.size() > 1 && l.comparable);
  if (!known || l.held == l.sim().steps || (s.view.colour != Colour::motion && !l.probe.reading)) return;
  if (right_now(s) && !is_kept(*l.right, l.sim().steps)) return;
  hold_vertices(l.lanes, right_now(s), l.renderer, l.answers);
  l.held = l.sim().steps;
}

void start_lanes(Session& s) {
  s.changes = {};
  ordered_json lanes;
  for (const Lane& lane : s.loaded.lanes) lanes.push_back(settings_text(lane.sim.settings));
  note(s, {{"lanes", lanes}});
  restart(s);
  for (const Lane& lane : s.loaded.lanes) s.log("lane {}", describe(lane));
}

// A soft body's second lane is a solver that converges, so that the first one's error is seen; else a lane is as the
// chosen one, to be changed.
static std::string words_of_next_lane(const Session& s) {
  const Sim& own = s.loaded.sim();
  if (s.loaded.lanes.size() > 1 || !has_forces(own.settings)) return "";
  constexpr double few = 100;
  const bool slow = solver_mode(own.settings).leapfrog || explicit_substeps(*own.model, own.settings) > few;
  return slow && !solver_mode(own.settings).implicit ? "newton" : slow ? "mode=newton,iterations=16" : "mode=explicit";
}

void add_lane(Session& s, const std::string& wanted) {
  finish_step(s);
  attempt(s, [&] {
    auto& lanes = s.loaded.lanes;
    if (lanes.size() >= most_lanes) return say(s, fmt::format("there are {} lanes: no more fit", most_lanes));
    const Sim& own = s.loaded.sim();
    let_go(s);
    const std::string words = wanted.empty() ? words_of_next_lane(s) : wanted;
    lanes.push_back({create_sim(own.model, lane_settings(own.settings, words, "--lane " + words, own.model))});
    // The panel stays with what is compared with the solver that converges.
    if (!wanted.empty() || words.empty()) s.loaded.chosen = lanes.size() - 1;
    s.ui.hinted[2] = true;
    start_lanes(s);
  });
}

void remove_lane(Session& s) {
  auto& lanes = s.loaded.lanes;
  if (lanes.size() == 1) return;
  finish_step(s);
  let_go(s);
  lanes.erase(lanes.begin() + std::ptrdiff_t(s.loaded.chosen));
  s.loaded.chosen = std::min(s.loaded.chosen, lanes.size() - 1);
  start_lanes(s);
}

void choose_lane(Session& s, std::size_t lane) {
  if (lane >= s.loaded.lanes.size() || lane == s.loaded.chosen) return;
  let_go(s);
  s.loaded.chosen = lane;
  s.loaded.renderer.values_copied = {};
  s.log("lane {} chosen", lane + 1);
}

void compare_lanes(Session& s, const std::vector<std::string>& words) {
  finish_step(s);
  attempt(s, [&] {
    const Sim& first = s.loaded.lanes.front().sim;
    const Settings base = words.empty() ? first.settings : s.loaded.scene.settings;
    std::vector<Lane> lanes;
    for (const std::string& own : words)
      lanes.push_back({create_sim(first.model, lane_settings(base, own, "--lane " + own, first.model))});
    let_go(s);
    if (words.empty())
      s.loaded.lanes.resize(1);
    else
      s.loaded.lanes = std::move(lanes);
    s.loaded.chosen = 0;
    start_lanes(s);
  });
}

void toggle_pin(Session& s, std::uint32_t vertex) {
  if (is_fixed(s, vertex)) return;
  finish_step(s);
  disturb(s);
  s.timeline.looping = false;
  s.timeline.touched.insert(vertex);
  const bool pinned = is_pinned(s.loaded.sim(), vertex);
  note(s, {{pinned ? "unpin" : "pin", vertex}});
  for (Lane& lane : s.loaded.lanes) pinned ? unpin(lane.sim, vertex) : pin(lane.sim, vertex);
  s.ui.hinted[1] = true;
  s.log("{} {}", pinned ? "unpin" : "pin", vertex);
}

void hold_vertex(Session& s, std::uint32_t vertex, std::size_t lane, double radius) {
  finish_step(s);
  disturb(s);
  s.timeline.looping = false;
  note(s, {{"grab", vertex}, {"lane", lane}, {"radius", radius}});
  s.hold = take_hold(s.loaded.lanes[lane].sim, vertex, radius);
  s.timeline.touched.insert(s.hold->vertices.begin(), s.hold->vertices.end());
  for (Lane& each : s.loaded.lanes) pin_held(each.sim, *s.hold);
}

void catch_vertex(Session& s, const Pick& pick) {
  if (is_fixed(s, pick.vertex)) return;
  hold_vertex(s, pick.vertex, s.loaded.chosen, s.grab_radius);
  s.grab = begin_grab(s.loaded.sim(), *s.hold, pick);
  s.ui.hinted[0] = true;
  s.log("grab {}", pick.vertex);
}

void let_go(Session& s) {
  if (!s.hold) return;
  finish_step(s);
  note(s, {{"release", s.hold->caught()}});
  for (Lane& lane : s.loaded.lanes) unpin_held(lane.sim, *s.hold);
  if (s.grab) s.log("release {} moved {:.4f}", s.hold->caught(), glm::length(s.grab->position - s.grab->start));
  s.grab.reset(), s.hold.reset();
}

std::optional<Advice> faster_way(const Session& s) {
  const Clock& clock = s.clock;
  const Settings& own = s.loaded.sim().settings;
  if (!s.playing || clock.fast || !(clock.factor > 0) || clock.factor > 0.5 * clock.speed()) return {};
  if (s.loaded.lanes.size() > 1) return Advice{"fewer lanes", ""};
  const auto& ms = s.loaded.lanes[s.loaded.chosen].step_ms.values;
  // Less than half of the time goes into steps.
  if (!ms.empty() && double(ms.back()) * clock.factor / own.dt < 500) {
    if (s.samples == 0 && !s.view.shadow) return Advice{"a smaller window", ""};
    return Advice{"turn off MSAA and shadows", "", [](Session& to) {
                    to.ui.kept.samples = to.samples = 0;
                    to.view.shadow = false, to.ui.kept.shadow = 0;
                    to.log("MSAA and shadows off");
                  }};
  }
  const bool with_forces = solver_mode(own).leapfrog || solver_mode(own).implicit;
  const SolverMode& fast = *std::ranges::find_if(solver_modes(), &SolverMode::all_cores);
  if (!solver_mode(own).all_cores && !with_forces && (s.gl.software || on_cpu(s.loaded.sim())))
    return Advice{fmt::format("mode {}", fast.name), fmt::format("mode={}", fast.name)};
  if (const Plan& plan = s.loaded.sim().plan; all_materials(own, hard) && plan.iterations * plan.substeps > 5)
    return Advice{"solver hard", "hard,mode=" + own.mode};
  return Advice{"a smaller scene", ""};
}

void advance(Session& s, double elapsed) {
  Clock& clock = s.clock;
  clock.real += elapsed;
  ++clock.frames;
  if (clock.real >= 0.5) {
    clock.factor = clock.simulated / clock.real;
    if (s.playing)
      s.log("running {} {:.3f}x {:.0f} fps", s.loaded.sim().steps, clock.factor, clock.frames / clock.real);
    clock.frames = 0;
    clock.real = clock.simulated = 0;
  }
  if (!s.playing) return;
  const double dt = s.loaded.sim().settings.dt;
  clock.owed += std::min(elapsed, 0.25) * clock.speed();
  if (s.timeline.looping) return loop_on(s);
  // A driver that queues work hides what a step costs until the frame is late: then the number of steps a
  // frame is halved, and doubled while there is room. Where a step returns when it is done (CPU modes,
  // software GL) the time spent here says it all.
  const bool queued =
      !s.gl.software && std::ranges::none_of(s.loaded.lanes, [](const Lane& l) { return on_cpu(l.sim); });
  constexpr double patience = 0.04;  // s of stepping between two frames
  const auto begin = Steady::now();
  int taken = 0;
  // A step that takes longer than a frame may is taken in parts, so that the window answers in between.
  const bool in_parts = s.under_way || (!queued && s.step_seconds > patience);
  while ((clock.fast || clock.owed >= dt || s.under_way) && (!queued || taken < clock.most_steps)) {
    if (!in_parts)
      step_lanes(s);
    else if (!step_lanes(s, patience))
      break;
    clock.owed -= dt;
    ++taken;
    if (in_parts || seconds_since(begin) > patience) break;
  }
  if (queued && elapsed > 0.066) clock.most_steps = std::max(1, clock.most_steps / 2);
  if (queued && elapsed < 0.033 && taken == clock.most_steps)
    clock.most_steps = std::min(clock.most_steps * 2, 1 << 14);
  // What could not be simulated in time is dropped: the simulation then runs slower than real time.
  clock.owed = clock.fast ? 0 : std::min(clock.owed, dt);
}

// Energy that nothing supplied is said once.
static void follow_energy(Session& s, Lane& lane, const Measurement& now) {
  add_measurement(lane.ledger, now, *lane.sim.model, lane.sim.settings);
  if (lane.ledger.not_judged || now.by_hand) return;
  lane.created.add(100 * lane.ledger.relative(), now.time);
  if (lane.gain_said) return;
  const auto gain = judge_energy(lane.ledger, lane.sim);
  lane.gain_said = gain.has_value();
  if (gain) say(s, verdict_line({{*gain}}));
}

void measure_frame(Session& s, bool stepped) {
  for (Lane& lane : s.loaded.lanes) {
    while (const auto ms = lane.sim.timer.poll()) lane.step_ms.add(*ms, simulated_time(lane.sim));
    lane.sim.timed = s.measuring;
    if (!s.measuring) continue;
    if (!lane.metrics) lane.metrics = create_metrics(lane.sim);
    while (const auto now = collect(*lane.metrics)) {
      follow_energy(s, lane, *now);
      lane.volume_error.add(now->finite() ? now->volume_error_percent : 0.0, now->time);
      lane.energy.add(now->finite() ? now->energy() + now->elastic : 0.0, now->time);
      const double depth = now->penetration_max;  // NaN without obstacles
      if (!std::isnan(depth)) lane.depth.add(100 * depth, now->time);
    }
    // Half the ring of results: with more under way, asking again would wait for the oldest.
    if (stepped && lane.metrics->pending.size() < 8) measure(*lane.metrics, lane.sim, s.hold.has_value());
  }
}

bool is_filling(const Session& s) { return s.loaded.map && !s.loaded.map->is_done(); }

void fill_map(Session& s) {
  if (!is_filling(s)) return;
  const std::size_t before = s.loaded.map->done;
  const double budget = s.playing ? 0.008 : 0.03;  // s of a frame
  if (!attempt(s, [&] { fill_map(*s.loaded.map, budget); })) return s.loaded.map.reset();
  if (s.loaded.map->done > before && s.loaded.map->is_done()) s.log("map done");
}

void follow_shaders(Session& s) {
  const auto version = shader_folder_version();
  if (version == s.loaded.sim().shader_version) return;
  finish_step(s);
  const bool done = attempt(s, [&] {
    for (Lane& lane : s.loaded.lanes) rebuild_shaders(lane.sim), lane.metrics.reset();
    note(s, {{"shaders", "edited"}});
    reload_shaders(s.loaded.renderer);
    s.loaded.picker = make_picker(s.loaded.sim().model->rest);
    s.loaded.probe = {};
  });
  for (Lane& lane : s.loaded.lanes) lane.sim.shader_version = version;  // also after an error: said once an edit
  if (!done) return;
  std::erase_if(s.messages, [](const Message& m) { return m.error && m.text.starts_with("shader "); });
  say(s, "shaders compiled again");
}

}  // namespace tetpbd
