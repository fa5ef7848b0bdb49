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
#include "sim/contact/starts.h"
#include "sim/error.h"
#include "sim/model/material.h"
#include "sim/state_file.h"

namespace tetpbd {

namespace fs = std::filesystem;

void say_choice(Session& s) {
  s.budget_ms = s.loaded.choice->budget_ms;
  say(s, "solver: " + describe(*s.loaded.choice));
}

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

void find_right(Session& s) {
  const auto& lanes = s.loaded.lanes;
  auto& right = s.loaded.right;
  if (lanes.size() == 1 && s.view.colour != Colour::motion) return right.reset();
  const Sim& first = lanes[0].sim;
  const std::uint64_t key = motion_key(lanes[0]);
  s.loaded.comparable = std::ranges::all_of(lanes, [&](const Lane& lane) { return motion_key(lane) == key; });
  const long steps = std::max(1l, std::lround(s.loaded.scene.duration / first.settings.dt));
  if (!s.loaded.comparable) return right.reset();
  if (right && right->scene == key && right->kept.back() >= steps) return;
  right = right_motion(*first.model, first.settings);
  if (!right) right = rigid_motion(*first.model, first.settings, steps);
}

void disturb(Session& s) {
  if (!std::exchange(s.loaded.disturbed, true))
    for (Lane& lane : s.loaded.lanes) lane.distance = {}, lane.apart = {};
  for (Lane& lane : s.loaded.lanes) lane.ledger = {};
}

void forget_errors(Session& s) {
  std::erase_if(s.messages,
                [](const Message& m) { return m.error && !m.non_finite && !m.text.starts_with("shader "); });
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

void take_over(Session& s, Loaded loaded, bool keep_camera) {
  s.grab.reset(), s.hold.reset();
  s.step_seconds = 0;
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
  note_step(s);
  s.log("scene {} {} vertices", s.loaded.name, s.loaded.sim().model->positions.size());
  if (s.loaded.choice) say_choice(s);
  for (const StartMotion& motion : s.loaded.model->start_motions) say(s, describe(motion));
  for (const BodyFill& fill : s.loaded.model->fills)
    if (!fill.what.empty()) say(s, fmt::format("{}: {}", s.loaded.model->bodies[fill.body].name, fill.what));
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
  between_steps(s, [&s] {
    const fs::path file = free_name(file_stem(s.loaded.scene.name), "state");
    save_state(s.loaded.sim(), file);
    say(s, fmt::format("saved {}: open it here, or tetpbd run --from-state {}", file.string(), file.string()));
  });
}

void save_scene(Session& s) {
  attempt(s, [&] {
    const Model& model = *s.loaded.sim().model;
    Scene scene = s.loaded.scene;
    scene.settings = asked_settings(s);
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
  const auto size = [&](std::uint32_t v) {
    const bool seen = std::isfinite((*values)[v]) && !is_hidden(s.loaded.renderer, v);
    return seen ? std::abs((*values)[v]) : -1.0f;
  };
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
  if (!known || l.held == l.lane().steps() || (s.view.colour != Colour::motion && !l.probe.reading)) return;
  if (right_now(s) && !is_kept(*l.right, l.lane().steps())) return;
  hold_vertices(l.lanes, right_now(s), l.renderer, l.answers);
  l.held = l.lane().steps();
}

void follow_shaders(Session& s) {
  const auto version = shader_folder_version();
  if (version == s.loaded.sim().shader_version) return;
  if (s.under_way) return between_steps(s, [&s] { follow_shaders(s); });
  const bool done = attempt(s, [&] {
    for (Lane& lane : s.loaded.lanes) rebuild_shaders(lane.sim), lane.metrics.reset();
    if (s.record) write(s, {{"step", s.record->step}, {"shaders", "edited"}});  // no replay knows them
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
