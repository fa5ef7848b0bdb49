#include "app/window/record.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "app/bodies.h"
#include "app/files.h"
#include "app/obstacles.h"
#include "app/window/session.h"
#include "sim/error.h"

namespace tetpbd {

namespace {

ordered_json scene_line(const Session& s) {
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
  return scene;
}

ordered_json view_json(const action::SetView& a) {
  const ViewOptions& v = a.view;
  return {{"look", look_names[std::size_t(v.look)]},
          {"colour", colour_names[std::size_t(v.colour)]},
          {"range", {v.range().low, v.range().high}},
          {"cut", {v.cut, v.cut_axis, v.cut_normal.x, v.cut_normal.y, v.cut_normal.z}},
          {"shrink", v.shrink},
          {"explode", v.explode},
          {"contacts", v.contacts},
          {"arrows", v.arrows},
          {"overlay", a.overlaid},
          {"ghost", a.ghost}};
}

action::SetView view_of(const Session& s) { return {s.view, s.overlaid, s.ghost}; }

// ------------------------------------------------------------------------------------------------------------
// an action as a line

using namespace action;

ordered_json json_of(const Session& s, const StartLanes& a) {
  ordered_json lanes = ordered_json::array();
  for (const Settings& settings : a.lanes) lanes.push_back(settings_text(settings, &s.loaded.scene.settings));
  return {{"lanes", lanes}};
}
ordered_json json_of(const Session& s, const Set& a) {
  return {{"lane", a.lane}, {"set", settings_text(a.settings, &s.loaded.lanes[a.lane].sim.settings)}};
}
ordered_json json_of(const Session&, const SetObstacles& a) {
  ordered_json list = ordered_json::array();
  for (const Obstacle& o : a.obstacles) list.push_back(ordered_json(obstacle_json(o)));
  return {{"obstacles", list}};
}
ordered_json json_of(const Session&, const OpenState& a) {
  return {{"state", std::filesystem::absolute(a.file).string()}};
}
ordered_json json_of(const Session&, const Reset&) { return {{"reset", true}}; }
ordered_json json_of(const Session&, const GoBack&) { return {{"back", true}}; }
ordered_json json_of(const Session&, const Catch& a) {
  return {{"grab", a.vertex}, {"lane", a.lane}, {"radius", a.radius}};
}
ordered_json json_of(const Session&, const Lead& a) { return {{"move", {a.vertex, a.to.x, a.to.y, a.to.z}}}; }
ordered_json json_of(const Session& s, const Release&) { return {{"release", s.hold->caught()}}; }
ordered_json json_of(const Session&, const Pin& a) { return {{"pin", a.vertex}}; }
ordered_json json_of(const Session&, const Unpin& a) { return {{"unpin", a.vertex}}; }
ordered_json json_of(const Session&, const SetSpeed& a) { return {{"speed", std::ldexp(1.0, -a.halvings)}}; }
ordered_json json_of(const Session&, const SetCamera& a) {
  const Camera& c = a.camera;
  return {{"camera", {c.target.x, c.target.y, c.target.z, c.distance, c.azimuth, c.elevation}}};
}
ordered_json json_of(const Session&, const auto&) { return nullptr; }  // OpenScene, Go, SetView

// ------------------------------------------------------------------------------------------------------------
// a line as an action

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

OpenScene read_load(const ordered_json& scene, const std::string& where) {
  OpenScene load{scene.at("scene"),
                 {.mesh = scene.value("mesh", ""),
                  .tetgen = scene.value("tetgen", ""),
                  .fill = scene.value("fill", ""),
                  .deform = scene.value("deform", ""),
                  .up = scene.value("up", ""),
                  .set = scene.value("set", std::vector<std::string>())}};
  SceneOverrides& overrides = load.overrides;
  for (const auto& [key, value] : {std::pair("height", &overrides.height), std::pair("tets", &overrides.tets),
                                   std::pair("spacing", &overrides.spacing)})
    if (scene.contains(key)) *value = scene[key];
  const Scene opened = load_scene(load.name, overrides);
  load.settings = opened.settings;
  if (scene.contains("settings")) set_all(*load.settings, scene["settings"], opened.bodies.size(), where);
  return load;
}

StartLanes read_lanes(const Session& s, const ordered_json& lanes, const std::string& where) {
  if (lanes.empty() || lanes.size() > most_lanes)
    throw Error(fmt::format("{} lanes", lanes.size()), where, fmt::format("give 1 to {}", most_lanes));
  StartLanes start;
  for (const ordered_json& values : lanes)
    set_all(start.lanes.emplace_back(s.loaded.scene.settings), values, s.loaded.scene.bodies.size(), where);
  return start;
}

SetView read_view(const Session& s, const ordered_json& given, const std::string& where) {
  SetView set = view_of(s);
  ordered_json view = view_json(set);
  view.update(given);
  const auto number_of = [&](const auto& names, const char* key) {
    const auto found = std::ranges::find(names, view.at(key).template get<std::string>());
    if (found == names.end()) throw Error(fmt::format("there is no {} {}", key, view[key].dump()), where, "see --help");
    return int(found - names.begin());
  };
  ViewOptions& v = set.view;
  v.look = Look(number_of(look_names, "look")), v.colour = Colour(number_of(colour_names, "colour"));
  v.range() = {view.at("range").at(0), view["range"].at(1)};
  const ordered_json& cut = view.at("cut");
  v.cut = cut.at(0), v.cut_axis = std::clamp(cut.at(1).get<int>(), 0, 3);
  v.cut_normal = {cut.at(2), cut.at(3), cut.at(4)};
  v.shrink = view.at("shrink"), v.explode = view.at("explode");
  v.contacts = view.at("contacts"), v.arrows = view.at("arrows");
  set.overlaid = view.at("overlay"), set.ghost = view.at("ghost");
  return set;
}

SetCamera read_camera(const Session& s, const ordered_json& c) {
  SetCamera set{s.camera};
  set.camera.target = {c.at(0), c.at(1), c.at(2)};
  set.camera.distance = c.at(3), set.camera.azimuth = c.at(4), set.camera.elevation = c.at(5);
  return set;
}

}  // namespace

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

std::optional<ordered_json> line_of(const Session& s, const Action& action) {
  if (!s.record) return std::nullopt;
  const ordered_json json = std::visit([&](const auto& a) { return json_of(s, a); }, action);
  if (json.is_null()) return std::nullopt;
  ordered_json line = {{"step", s.record->step}};
  line.update(json);
  return line;
}

void write(Session& s, const ordered_json& line) {
  if (s.record && !attempt(s, [&] { s.record->file.add(json_text(line, -1) + "\n"); })) s.record.reset();
}

void note(Session& s, const Action& action) {
  note_moment(s);
  if (const auto line = line_of(s, action)) write(s, *line);
}

void note_scene(Session& s) {
  if (s.record) write(s, {{"step", s.record->step}, {"load", scene_line(s)}});
}

void note_moment(Session& s) {
  if (!s.record || !std::exchange(s.record->shown, false)) return;
  write(s, {{"step", s.record->step}, {"go", steps_of(s.loaded.lanes)}});
  note_step(s);
}

void note_step(Session& s) {
  if (!s.record) return;
  s.record->step = steps_of(s.loaded.lanes), s.record->shown = false;
  ordered_json view = view_json(view_of(s));
  if (view == s.record->view) return;
  write(s, {{"step", s.record->step}, {"view", view}});
  if (s.record) s.record->view = std::move(view);
}

ordered_json state_hashes(Session& s) {
  ordered_json result = ordered_json::array();
  for (Lane& lane : s.loaded.lanes)
    result.push_back(check_finite(lane.sim, true) ? ordered_json()
                                                  : ordered_json(fmt::format("{:016x}", state_hash(lane.sim))));
  return result;
}

void end_record(Session& s) {
  if (!s.record) return;
  note_moment(s);
  write(s, {{"step", s.record->step}, {"end", state_hashes(s)}});
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
    line.json = ordered_json::parse(text, watch_depth, false);
    if (deep || !line.json.is_object() || !line.json.value("step", ordered_json()).is_number_integer())
      throw Error("no line of a record", line.where, "write one JSON object with \"step\" a line");
  }
  if (lines.empty() || !lines[0].json.contains("load"))
    throw Error("a record begins with a scene", file.string(), "its first line has \"load\"");
  return lines;
}

Action read_action(const Session& s, const RecordLine& line) {
  const auto& [where, a] = line;
  const auto vertex = [&](const ordered_json& value) {
    const auto number = value.get<std::uint32_t>();
    if (number >= s.loaded.sim().model->positions.size())
      throw Error(fmt::format("there is no vertex {}", number), where, "is it another mesh?");
    return number;
  };
  const std::size_t lane = a.value("lane", 0u);
  if (!a.contains("load") && lane >= s.loaded.lanes.size())
    throw Error(fmt::format("there is no lane {}", lane + 1), where, "the first is 0");
  if (a.contains("load")) return read_load(a["load"], where);
  if (a.contains("lanes")) return read_lanes(s, a["lanes"], where);
  if (a.contains("obstacles")) {
    SetObstacles set;
    for (const ordered_json& o : a["obstacles"]) set.obstacles.push_back(read_obstacle(o, "obstacles", where, {}));
    return set;
  }
  if (a.contains("state")) return OpenState{a["state"].get<std::string>()};
  if (a.contains("reset")) return Reset{};
  if (a.contains("set")) {
    Set set{lane, s.loaded.lanes[lane].sim.settings};
    set_all(set.settings, a["set"], s.loaded.scene.bodies.size(), where);
    return set;
  }
  if (a.contains("grab")) return Catch{vertex(a["grab"]), lane, a.value("radius", 0.0)};
  if (a.contains("pin")) return Pin{vertex(a["pin"])};
  if (a.contains("unpin")) return Unpin{vertex(a["unpin"])};
  if (a.contains("release")) return Release{};
  if (a.contains("move")) {
    const ordered_json& to = a["move"];
    return Lead{vertex(to.at(0)), {to.at(1), to.at(2), to.at(3)}};
  }
  if (a.contains("go")) return Go{a["go"]};
  if (a.contains("back")) return GoBack{};
  if (a.contains("speed")) return SetSpeed{halvings_for(a["speed"])};
  if (a.contains("view")) return read_view(s, a["view"], where);
  if (a.contains("camera")) return read_camera(s, a["camera"]);
  throw Error("nothing known is done here", where, "see docs/guide.md");
}

}  // namespace tetpbd
