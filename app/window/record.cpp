#include "app/window/record.h"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/bodies.h"
#include "app/commands.h"
#include "app/files.h"
#include "app/obstacles.h"
#include "app/window/edit_obstacles.h"
#include "app/window/session.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

ordered_json settings_text(const Settings& settings, const Settings* before) {
  ordered_json result = ordered_json::object();
  for (const Parameter& row : parameters())
    if (const std::string text = parameter_text(settings, row); !before || text != parameter_text(*before, row))
      result[row.name] = text;
  for (std::size_t b = 0; b < settings.bodies.size(); ++b)
    if (!before || b >= before->bodies.size() || settings.bodies[b] != before->bodies[b])
      result["bodies"][std::to_string(b)] = body_settings_json(settings.bodies[b]);
  return result;
}

void note(Session& s, const ordered_json& action) {
  if (!s.record) return;
  note_moment(s);
  if (attempt(s, [&] {
        ordered_json line = {{"step", s.record->step}};
        line.update(action);
        s.record->file.add(json_text(line, -1) + "\n");
      }))
    return;
  s.record.reset();
}

void note_scene(Session& s) {
  const SceneOverrides& o = s.loaded.overrides;
  ordered_json scene = {{"scene", s.loaded.name}};
  if (!o.mesh.empty()) scene["mesh"] = o.mesh.string();
  if (!o.tetgen.empty()) scene["tetgen"] = o.tetgen;
  if (!o.fill.empty()) scene["fill"] = o.fill;
  if (o.tets) scene["tets"] = *o.tets;
  if (o.spacing) scene["spacing"] = *o.spacing;
  if (!o.deform.empty()) scene["deform"] = o.deform;
  if (!o.up.empty()) scene["up"] = o.up;
  if (o.height) scene["height"] = *o.height;
  if (!o.set.empty()) scene["set"] = o.set;
  scene["settings"] = settings_text(s.loaded.scene.settings);
  note(s, {{"load", scene}});
}

void note_moment(Session& s) {
  if (!s.record || !std::exchange(s.record->shown, false)) return;
  note(s, {{"go", steps_of(s.loaded.lanes)}});
  note_step(s);
}

void note_camera(Session& s) {
  const Camera& c = s.camera;
  note(s, {{"camera", {c.target.x, c.target.y, c.target.z, c.distance, c.azimuth, c.elevation}}});
}

namespace {

ordered_json view_json(const Session& s) {
  const ViewOptions& v = s.view;
  return {{"look", look_names[std::size_t(v.look)]},
          {"colour", colour_names[std::size_t(v.colour)]},
          {"range", {v.range().low, v.range().high}},
          {"cut", {v.cut, v.cut_axis, v.cut_normal.x, v.cut_normal.y, v.cut_normal.z}},
          {"shrink", v.shrink},
          {"explode", v.explode},
          {"contacts", v.contacts},
          {"arrows", v.arrows},
          {"overlay", s.overlaid},
          {"ghost", s.ghost}};
}

void set_view(Session& s, const ordered_json& given, const std::string& where) {
  ordered_json view = view_json(s);
  view.update(given);
  const auto number_of = [&](const auto& names, const char* key) {
    const auto found = std::ranges::find(names, view.at(key).template get<std::string>());
    if (found == names.end()) throw Error(fmt::format("there is no {} {}", key, view[key].dump()), where, "see --help");
    return int(found - names.begin());
  };
  ViewOptions& v = s.view;
  v.look = Look(number_of(look_names, "look"));
  const Colour colour = Colour(number_of(colour_names, "colour"));
  if (colour != v.colour) choose_colour(s, colour);
  s.fit_range = false;
  v.range() = {view.at("range").at(0), view["range"].at(1)};
  const ordered_json& cut = view.at("cut");
  v.cut = cut.at(0), v.cut_axis = std::clamp(cut.at(1).get<int>(), 0, 3);
  v.cut_normal = {cut.at(2), cut.at(3), cut.at(4)};
  v.shrink = view.at("shrink"), v.explode = view.at("explode");
  v.contacts = view.at("contacts"), v.arrows = view.at("arrows");
  s.overlaid = view.at("overlay"), s.ghost = view.at("ghost");
}

// Null where the state is not finite: when that is found depends on the machine.
ordered_json hashes(Session& s) {
  ordered_json result = ordered_json::array();
  for (Lane& lane : s.loaded.lanes)
    result.push_back(check_finite(lane.sim, true) ? ordered_json()
                                                  : ordered_json(fmt::format("{:016x}", state_hash(lane.sim))));
  return result;
}

// Of a model of `count` bodies.
void set_all(Settings& settings, const ordered_json& values, std::size_t count, const std::string& where) {
  for (const auto& [name, value] : values.items()) {
    if (name == "bodies") {
      for (const auto& [number, own] : value.items()) {
        const std::size_t body = body_number(number, count, where);
        settings.bodies.resize(count);
        settings.bodies[body] = read_body_settings(own, settings, fmt::format("bodies.{}", body), where);
      }
      continue;
    }
    const Parameter* row = find_parameter(name);
    if (!row) throw Error(fmt::format("'{}' is no setting", name), where, "see docs/guide.md");
    set_parameter(settings, *row, setting_text(*row, value), where);
  }
}

void load_scene_of(Session& s, const ordered_json& scene, const std::string& where) {
  SceneOverrides overrides{.mesh = scene.value("mesh", ""),
                           .tetgen = scene.value("tetgen", ""),
                           .fill = scene.value("fill", ""),
                           .deform = scene.value("deform", ""),
                           .up = scene.value("up", ""),
                           .set = scene.value("set", std::vector<std::string>())};
  for (const auto& [key, value] : {std::pair("height", &overrides.height), std::pair("tets", &overrides.tets),
                                   std::pair("spacing", &overrides.spacing)})
    if (scene.contains(key)) *value = scene[key];
  const std::string name = scene.at("scene");
  Scene opened = load_scene(name, overrides);
  if (scene.contains("settings")) set_all(opened.settings, scene["settings"], opened.bodies.size(), where);
  opened.mode_open = false, opened.budget_ms.reset();
  take_over(s, load(name, overrides, opened), false);
}

void apply(Session& s, const ordered_json& a, const std::string& where) {
  auto& lanes = s.loaded.lanes;
  const auto vertex = [&](const ordered_json& value) {
    const auto number = value.get<std::uint32_t>();
    if (number >= s.loaded.sim().model->positions.size())
      throw Error(fmt::format("there is no vertex {}", number), where, "is it another mesh?");
    return number;
  };
  const auto lane_of = [&] {
    const std::size_t lane = a.value("lane", 0u);
    if (lane >= lanes.size()) throw Error(fmt::format("there is no lane {}", lane + 1), where, "the first is 0");
    return lane;
  };
  if (a.contains("load")) {
    load_scene_of(s, a["load"], where);
  } else if (a.contains("lanes")) {
    if (a["lanes"].empty() || a["lanes"].size() > most_lanes)
      throw Error(fmt::format("{} lanes", a["lanes"].size()), where, fmt::format("give 1 to {}", most_lanes));
    std::vector<Lane> made;
    for (const ordered_json& values : a["lanes"]) {
      Settings settings = s.loaded.scene.settings;
      set_all(settings, values, s.loaded.scene.bodies.size(), where);
      made.push_back({create_sim(s.loaded.sim().model, settings)});
    }
    lanes = std::move(made);
    s.loaded.chosen = 0;
    start_lanes(s);
  } else if (a.contains("obstacles")) {
    std::vector<Obstacle> wanted;
    for (const ordered_json& o : a["obstacles"]) wanted.push_back(read_obstacle(o, "obstacles", where, {}));
    change_obstacles(s, std::move(wanted));
  } else if (a.contains("state")) {
    open_state(s, a["state"].get<std::string>());
  } else if (a.contains("reset")) {
    restart(s);
  } else if (a.contains("set")) {
    const std::size_t lane = lane_of();
    Settings settings = lanes[lane].sim.settings;
    set_all(settings, a["set"], s.loaded.scene.bodies.size(), where);
    const std::size_t chosen = std::exchange(s.loaded.chosen, lane);
    change_settings(s, settings);
    s.loaded.chosen = chosen;
  } else if (a.contains("grab")) {
    hold_vertex(s, vertex(a["grab"]), lane_of(), a.value("radius", 0.0));
  } else if (a.contains("pin")) {
    const std::uint32_t pinned = vertex(a["pin"]);
    s.timeline.touched.insert(pinned);
    for (Lane& lane : lanes) pin(lane.sim, pinned);
    s.loaded.disturbed = true;
  } else if (a.contains("unpin")) {
    const std::uint32_t freed = vertex(a["unpin"]);
    for (Lane& lane : lanes) unpin(lane.sim, freed);
  } else if (a.contains("release")) {
    let_go(s);
  } else if (a.contains("move")) {
    const ordered_json& to = a["move"];
    const std::uint32_t moved = vertex(to.at(0));
    const glm::dvec3 place(to.at(1), to.at(2), to.at(3));
    const bool held = s.hold && s.hold->caught() == moved;
    for (Lane& lane : lanes) held ? move_held(lane.sim, *s.hold, place) : move_pinned(lane.sim, moved, place);
  } else if (a.contains("go")) {
    show_step(s, a["go"]);
    if (steps_of(lanes) != a["go"])
      throw Error(fmt::format("step {} is not known", a["go"].dump()), where, "go back only");
  } else if (a.contains("back")) {
    go_back(s);
  } else if (a.contains("speed")) {
    change_speed(s, int(std::lround(-std::log2(std::clamp(a["speed"].get<double>(), 1e-3, 1.0)))));
  } else if (a.contains("view")) {
    set_view(s, a["view"], where);
  } else if (a.contains("camera")) {
    const ordered_json& c = a["camera"];
    s.camera.target = {c.at(0), c.at(1), c.at(2)};
    s.camera.distance = c.at(3), s.camera.azimuth = c.at(4), s.camera.elevation = c.at(5);
  } else if (!a.contains("end")) {
    throw Error("nothing known is done here", where, "see docs/guide.md");
  }
}

}  // namespace

void note_step(Session& s) {
  if (!s.record) return;
  s.record->step = steps_of(s.loaded.lanes), s.record->shown = false;
  if (ordered_json view = view_json(s); view != s.record->view) {
    s.record->view = view;
    note(s, {{"view", std::move(view)}});
  }
}

void end_record(Session& s) {
  if (!s.record) return;
  note(s, {{"end", hashes(s)}});
  if (s.record) s.record->file.close();
  s.record.reset();
}

std::vector<RecordLine> read_record(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw Error("cannot be read", file.string(), "give a file that tetpbd view --record wrote");
  std::vector<RecordLine> lines;
  std::string text;
  for (long number = 1; std::getline(in, text); ++number) {
    if (text.empty()) continue;
    bool deep = false;  // printing and copying JSON is recursive
    const auto watch_depth = [&](int depth, auto, auto&) { return !(deep = deep || depth > 8); };
    RecordLine& line = lines.emplace_back(fmt::format("{}:{}", file.string(), number));
    line.action = ordered_json::parse(text, watch_depth, false);
    if (deep || !line.action.is_object() || !line.action.value("step", ordered_json()).is_number_integer())
      throw Error("no line of a record", line.where, "write one JSON object with \"step\" a line");
  }
  if (lines.empty() || !lines[0].action.contains("load"))
    throw Error("a record begins with a scene", file.string(), "its first line has \"load\"");
  return lines;
}

int run_replay(const RunOptions& options) {
  const std::vector<RecordLine> lines = read_record(options.replay);
  make_output_folder(options.out);
  HeadlessContext context(options.gpu);
  Session s;
  s.gl = context.capabilities();
  s.playing = s.measuring = false;
  s.view = options.view;
  s.aspect = float(options.size[0]) / float(options.size[1]);
  s.timeline.budget = std::size_t(4) << 30;
  s.timeline.wanted.emplace();
  for (const RecordLine& line : lines)
    if (const auto go = line.action.value("go", ordered_json()); go.is_number_integer())
      s.timeline.wanted->insert(go.get<long>());

  const Target target = make_target(options.size[0], options.size[1], options.samples);
  std::optional<Video> video;
  constexpr int rate = 30;  // frames a second
  if (!options.video.empty()) video.emplace(options.video, options.size[0], options.size[1], rate);
  double owed = 1.0 / rate;  // s of the video, not yet drawn
  const auto draw_frames = [&] {
    for (; video && owed >= 1.0 / rate; owed -= 1.0 / rate) {
      draw_lanes(s, target);
      video->add(read_rgba(target));
      follow_bodies(s, 1.0 / rate);
    }
  };
  long steps = 0;  // in all
  ordered_json recorded;
  for (const auto& [where, action] : lines) {
    const long until = action["step"];
    try {
      while (!s.loaded.lanes.empty() && steps_of(s.loaded.lanes) < until && !interrupted()) {
        const long before = steps_of(s.loaded.lanes);
        draw_frames();
        step_lanes(s);
        owed += s.loaded.sim().settings.dt / s.clock.speed();
        if (steps_of(s.loaded.lanes) == before)
          throw Error(fmt::format("no lane comes to step {}", until), where, "no state is finite any more", 1);
        ++steps;
      }
      if (interrupted()) throw Error("interrupted", where, "there is no video", 1);
      apply(s, action, where);
    } catch (const ordered_json::exception& problem) {
      throw Error("no line of a record", where, problem.what());
    }
    for (const Message& message : s.messages)
      if (message.error) throw Error(message.text, where, "so it cannot be done again", 1);
    if (action.contains("end")) recorded = action["end"];
  }
  draw_frames();
  if (video) video->close();

  const ordered_json found = hashes(s);
  ordered_json result = {{"record", options.replay.string()}, {"steps", steps}};
  for (std::size_t i = 0; i < s.loaded.lanes.size(); ++i) {
    const Lane& lane = s.loaded.lanes[i];
    result["lanes"].push_back({{"mode", lane.sim.settings.mode}, {"step", lane.sim.steps}, {"state_hash", found[i]}});
    fmt::print("{}: step {}, state {}\n", describe(lane), lane.sim.steps, json_text(found[i], -1));
  }
  result["as_recorded"] = recorded.is_null() ? ordered_json() : ordered_json(recorded == found);
  write_file(options.out / "replay.json", json_text(result, 2) + "\n");
  if (!recorded.is_null() && recorded != found)
    throw Error("other states than recorded", options.replay.string(),
                "was it recorded on this machine and with this version?", 1);
  return 0;
}

}  // namespace tetpbd
