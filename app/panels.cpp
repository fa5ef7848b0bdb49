// The panel at the right: run, scene, solver, world, view. Widgets of parameters are made from their rows.
#include <fmt/ranges.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string_view>
#include <tuple>

#include "app/ui.h"
#include "sim/material.h"

namespace tetpbd {

namespace {

using Words = std::vector<std::string>;

// What a widget means, while the cursor is over it, and where it is, for tests.
void describe_item(Session& s, const std::string& name, const std::string& help = "") {
  mark(s, name);
  if (help.empty() || ImGui::IsItemActive() || !ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled))
    return;
  ImGui::BeginTooltip();
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 24);
  ImGui::TextUnformatted(help.c_str());
  ImGui::PopTextWrapPos();
  ImGui::EndTooltip();
}

// Label at the left, the widget, whose id this gives, in the rest of the line.
std::string begin_row(const std::string& label) {
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(label.c_str());
  ImGui::SameLine(label_width());
  ImGui::SetNextItemWidth(-1);
  return "##" + label;
}

bool button(Session& s, const char* label, const char* name, const char* help, float width = 0) {
  const bool pressed = ImGui::Button(label, ImVec2(width, 0));
  describe_item(s, name, help);
  return pressed;
}

bool check_box(Session& s, const char* label, bool& value, const std::string& help = "") {
  const bool changed = ImGui::Checkbox(label, &value);
  if (changed) s.log("{} {}", label, value);
  describe_item(s, label, help);
  return changed;
}

// The word chosen, once.
std::optional<std::string> combo(Session& s, const std::string& label, const std::string& now,
                                 const Words& words, const std::string& help = "") {
  std::optional<std::string> chosen;
  if (ImGui::BeginCombo(begin_row(label).c_str(), now.c_str(), ImGuiComboFlags_HeightLarge)) {
    for (const std::string& word : words) {
      if (ImGui::Selectable(word.c_str(), word == now)) chosen = word;
      mark(s, label + "=" + word);
    }
    ImGui::EndCombo();
  }
  describe_item(s, label, help);
  return chosen;
}

// For an enumeration whose names are in its order.
template <class Enum, class Names>
void enum_combo(Session& s, const char* label, const Names& names, Enum& value) {
  const auto chosen = combo(s, label, names[std::size_t(value)], Words(std::begin(names), std::end(names)));
  if (!chosen) return;
  value = Enum(std::ranges::find(names, *chosen) - std::begin(names));
  s.log("{} {}", label, *chosen);
}

bool slider(Session& s, const char* label, double& value, double low, double high, const char* format,
            const char* help, bool logarithmic = false) {
  const int flags = ImGuiSliderFlags_AlwaysClamp | (logarithmic ? ImGuiSliderFlags_Logarithmic : 0);
  const bool changed =
      ImGui::SliderScalar(begin_row(label).c_str(), ImGuiDataType_Double, &value, &low, &high, format, flags);
  describe_item(s, label, help);
  return changed;
}

template <class T>
bool number_widget(const Parameter& row, const std::string& id, T& value) {
  constexpr bool real = std::is_same_v<T, double>;
  constexpr ImGuiDataType type = real ? ImGuiDataType_Double : ImGuiDataType_S32;
  const T low = T(row.low), high = T(row.high), before = value;
  // A logarithmic slider takes what its format does not show for 0: it has to hold decades down to 1e-12.
  const std::string number = !real ? "%d" : row.logarithmic ? "%.12g" : "%.4g";
  const std::string format = number + (*row.unit ? " " : "") + row.unit;
  bool changed = false;
  if (row.logarithmic || row.high - row.low <= 20) {
    const int flags = ImGuiSliderFlags_AlwaysClamp | (row.logarithmic ? ImGuiSliderFlags_Logarithmic : 0);
    changed = ImGui::SliderScalar(id.c_str(), type, &value, &low, &high, format.c_str(), flags);
  } else {  // a linear slider over a wide range cannot be aimed: such a value is dragged, by a part of itself
    const float speed = real ? 0.01f * std::max(1.0f, std::abs(float(value))) : 1.0f;
    changed = ImGui::DragScalar(id.c_str(), type, &value, speed, &low, &high, format.c_str(),
                                ImGuiSliderFlags_AlwaysClamp);
  }
  if (changed && real) value = T(std::stod(fmt::format("{:.4g}", double(value))));
  if (!(value >= low && value <= high)) value = before;  // "nan" was typed
  return changed && value != before;
}

std::string help_text(const Parameter& row) {
  std::string text = row.help;
  if (choices(row).empty() && !std::holds_alternative<bool Settings::*>(row.member))
    text += fmt::format("\n{:g} to {:g}{}{}; Ctrl+click to type", row.low, row.high, *row.unit ? " " : "",
                        row.unit);
  if (row.effect == Effect::restart) text += "\ntakes effect at the next reset";
  return text + fmt::format("\n{}", flag_name(row));
}

// A row of check boxes for a list of words.
bool words_widget(Session& s, const Parameter& row, std::string& value) {
  Words chosen = split(value, ',');
  bool changed = false;
  int place = 0;
  for (const std::string& word : choices(row)) {
    if (place++ % 3) ImGui::SameLine();
    bool on = std::ranges::count(chosen, word) > 0;
    if (!check_box(s, word.c_str(), on, help_text(row))) continue;
    changed = true;
    on ? chosen.push_back(word) : void(std::erase(chosen, word));
  }
  if (changed) value = fmt::format("{}", fmt::join(chosen, ","));
  return changed;
}

// What has no effect, as the stiffness of a kind that is switched off.
bool is_idle(const Settings& settings, const Parameter& row) {
  if (row.name == "mass_splitting") return compliant(settings);  // brings it with it
  if (row.name == "stability") return !leaps(settings);
  if (row.name == "omega" && is_implicit(settings)) return true;
  if (leaps(settings) && (row.name == "substeps" || row.name == "iterations" || row.name == "omega"))
    return true;
  if (row.name == "rigid_contact") {
    Settings on = settings;
    on.rigid_contact = true;
    return !rigid_in_contact(on);
  }
  if (row.name == "restitution") return settings.restitution == 0 && !rigid_in_contact(settings);
  const bool material = settings.material != "none";
  if (row.name == "young_modulus" || row.name == "poisson_ratio") return !material;
  const auto* of = std::get_if<KindMember>(&row.member);
  return of && (material || !uses(settings, constraint_kinds[of->kind]));
}

bool parameter_widget(Session& s, const Parameter& row, Settings& settings) {
  if (const auto* word = std::get_if<std::string Settings::*>(&row.member)) {
    if (std::string_view(row.name) == "constraints") return words_widget(s, row, settings.**word);
    const auto chosen = combo(s, row.name, settings.**word, choices(row), help_text(row));
    if (chosen) settings.** word = *chosen;
    return chosen.has_value();
  }
  ImGui::BeginDisabled(is_idle(settings, row));
  const std::string id = begin_row(label_of(row.name.c_str()));
  bool changed = false;
  with_value(settings, row, [&]<class T>(T& value) {
    if constexpr (std::is_same_v<T, bool>)
      changed = ImGui::Checkbox(id.c_str(), &value);
    else if constexpr (!std::is_same_v<T, std::string>)
      changed = number_widget(row, id, value);
  });
  describe_item(s, row.name, help_text(row));
  ImGui::EndDisabled();
  return changed;
}

void draw_parameters(Session& s, std::string_view section) {
  Settings wanted = s.loaded.sim().settings;
  bool changed = false;
  for (const Parameter& row : parameters())
    if (section == row.section) changed |= parameter_widget(s, row, wanted);
  if (changed) change_settings(s, wanted);
}

// A choice among presets; `current`: the one that is set, if any.
struct Ways {
  std::string current = "as set below", help;
  Words words;
  std::map<std::string, Settings> to{};
};
Ways ways_of(const Settings& now, const std::vector<Preset>& presets, const std::string& help) {
  Ways ways{.help = help, .words = names_of(presets)};
  for (const Preset& preset : presets) {
    apply_preset(ways.to[preset.name] = now, presets, preset.name);
    if (ways.to[preset.name] == now) ways.current = preset.name;
    ways.help += fmt::format("\n{}: {}", preset.name, preset.help);
  }
  return ways;
}

// The whole way to solve by one word, and what auto picked.
void draw_solver(Session& s) {
  const Settings now = s.loaded.sim().settings;
  const auto& choice = s.loaded.choice;
  const bool automatic = choice && choice->settings() == now;
  Ways ways = ways_of(now, solver_presets(),
                      "--solver\nauto: tries ways to solve this scene and takes the one whose motion is "
                      "nearest to the right one within the budget");
  if (automatic) ways.current = "auto";
  ways.words.push_back("auto");
  if (const auto chosen = combo(s, "solver", ways.current, ways.words, ways.help))
    ways.to.contains(*chosen) ? change_settings(s, ways.to[*chosen]) : choose_soon(s);
  const Watch& watch = s.loaded.sim().watch;
  if (leaps(now))
    ImGui::TextWrapped("%d substeps%s", now.substeps,
                       watch.stiffening > 1
                           ? fmt::format(", {:.2g} times as many as at rest", watch.stiffening).c_str()
                           : "");
  if (is_implicit(now))
    ImGui::TextWrapped(
        "residual %.1e of the start's, health %.2f%s", watch.residual, watch.health,
        watch.finer > 1 ? fmt::format("; {} times the substeps until no tet is inverted", watch.finer).c_str()
                        : "");
  if (!automatic) return;
  slider(s, "budget", s.budget_ms, 0.01, 100, "%.3g ms per step",
         "GPU time that a step may take; choosing again takes a second or so\n--budget-ms", true);
  if (ImGui::IsItemDeactivatedAfterEdit()) choose_soon(s);
  ImGui::TextWrapped("%s", describe(*choice).c_str());
}

// What the body is made of, by name; its numbers are below.
void draw_material(Session& s) {
  Ways ways = ways_of(s.loaded.sim().settings, material_presets(), "a material by name");
  if (const auto chosen = combo(s, "made of", ways.current, ways.words, ways.help))
    change_settings(s, ways.to[*chosen]);
}

void draw_run(Session& s) {
  const float gap = ImGui::GetStyle().ItemSpacing.x, width = (ImGui::GetContentRegionAvail().x - 2 * gap) / 3;
  if (button(s, s.playing ? "Pause##play" : "Play##play", "play", "Space", width)) play(s, !s.playing);
  ImGui::SameLine();
  if (button(s, "Step", "step", "S", width)) single_step(s);
  ImGui::SameLine();
  if (button(s, "Reset", "reset", "R", width)) restart(s);
  check_box(s, "fast", s.clock.fast, "steps as often as the machine can, instead of in real time");
  ImGui::SameLine(label_width());
  check_box(s, "vsync", s.vsync, "draw as often as the display shows");
}

void draw_scene(Session& s) {
  if (const auto name = combo(s, "scene", s.loaded.scene.name, scene_names(), s.loaded.scene.description))
    load_soon(s, *name, {}, false, false);
  begin_row("mesh file");
  ImGui::SetNextItemWidth(-ImGui::CalcTextSize("Load").x - 3 * ImGui::GetStyle().ItemSpacing.x);
  bool load_it =
      ImGui::InputTextWithHint("##mesh", "path, Enter", &s.ui.mesh, ImGuiInputTextFlags_EnterReturnsTrue);
  describe_item(
      s, "mesh",
      "in place of the scene's first body: .ply .obj .stl .off surfaces, .node/.ele .msh tetrahedra");
  ImGui::SameLine();
  load_it |= button(s, "Load", "load", "");
  if (!load_it || s.ui.mesh.empty()) return;
  SceneOverrides overrides = s.loaded.overrides;
  overrides.mesh = s.ui.mesh;
  load_soon(s, s.loaded.name, overrides, true, false);
}

void draw_lane_rows(Session& s) {
  const auto& lanes = s.loaded.lanes;
  const std::string help =
      "the same bodies solved in several ways at once: pull one and all are pulled; the panel is of the "
      "chosen lane";
  Ways ways{.help = help, .words = {}};
  for (const Comparison& row : comparisons())
    ways.words.push_back(row.name), ways.help += fmt::format("\n{}: {}", row.name, row.help);
  if (const auto name =
          combo(s, "side by side", lanes.size() > 1 ? "as below" : "one way", ways.words, ways.help))
    compare_lanes(s, std::ranges::find(comparisons(), *name, &Comparison::name)->lanes);
  const float gap = ImGui::GetStyle().ItemSpacing.x, width = (ImGui::GetContentRegionAvail().x - gap) / 2;
  if (button(s, "Add a lane", "add lane", "K", width)) add_lane(s);
  ImGui::SameLine();
  ImGui::BeginDisabled(lanes.size() < 2);
  if (button(s, "Remove this one", "remove lane", "J", width)) remove_lane(s);
  ImGui::EndDisabled();
  if (lanes.size() < 2) return;
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const glm::vec3 colour = lane_colour(i);
    ImGui::ColorButton(fmt::format("##colour {}", i).c_str(), ImVec4(colour.x, colour.y, colour.z, 1),
                       ImGuiColorEditFlags_NoTooltip);
    ImGui::SameLine();
    if (ImGui::Selectable(fmt::format("{}##lane {}", describe(lanes[i]), i).c_str(), i == s.loaded.chosen))
      choose_lane(s, i);
    mark(s, fmt::format("lane {}", i + 1));
  }
  check_box(s, "overlaid", s.overlaid, "all lanes in one place, in their colours");
  ImGui::SameLine(label_width());
  check_box(s, "ghost", s.ghost, "beside each lane the one that is nearest to the right motion");
}

void draw_colour_range(Session& s) {
  if (s.view.colour == Colour::plain) {
    ImGui::ColorEdit3(begin_row("body colour").c_str(), &s.view.body_colour.x, ImGuiColorEditFlags_NoInputs);
    mark(s, "body colour");
    return;
  }
  if (s.view.colour == Colour::patch) return;
  ColourRange& range = s.view.range();
  const ColourScale& scale = s.view.scale();
  double high = range.high * scale.factor;
  const std::string unit = scale.factor == 100 ? "%%" : scale.unit;
  if (slider(s, "colour range", high, 1e-4 * scale.most * scale.factor, scale.most * scale.factor,
             ((scale.is_signed ? "+/- %.3g " : "0 .. %.3g ") + unit).c_str(), scale.unit, true))
    range = {scale.is_signed ? -high / scale.factor : 0, high / scale.factor}, s.view.hold_range = true;
  check_box(s, "hold range", s.view.hold_range, "else it follows the values of now");
  ImGui::SameLine(label_width());
  check_box(s, "mark worst", s.view.worst,
            "rings around the vertices with the largest values, inside bodies too\nW");
  if (!s.view.worst) return;
  for (const auto& [vertex, value] : s.worst)
    ImGui::TextDisabled(
        "%s", fmt::format(fmt::runtime(scale.is_signed ? "vertex {}: {:+.3g} {}" : "vertex {}: {:.3g} {}"),
                          s.loaded.sim().model->original[vertex], double(value) * scale.factor, scale.unit)
                  .c_str());
}

void draw_view(Session& s) {
  ViewOptions& view = s.view;
  enum_combo(s, "look", look_names, view.look);
  const Words colours(colour_names.begin(), colour_names.end());
  if (const auto name = combo(s, "colour", colour_names[std::size_t(view.colour)], colours))
    choose_colour(s, Colour(std::ranges::find(colour_names, *name) - colour_names.begin()));
  draw_colour_range(s);
  if (view.look == Look::tets) {
    slider(s, "shrink", view.shrink, 0, 1, "%.2f", "each tetrahedron, towards its centre");
    slider(s, "explode", view.explode, 0, 3, "%.2f", "tetrahedra away from the bodies' centre");
  }
  slider(s, "cut", view.cut, 0, 1, "%.2f",
         "what is below this part of the bodies at rest is shown; 1: all\nAlt+drag, Alt+wheel on the view");
  const int before = view.cut_axis;
  enum_combo(s, "cut along", cut_names, view.cut_axis);
  if (view.cut_axis != before) view.cut_normal = glm::normalize(eye(s.camera) - s.camera.target);
  const std::tuple<const char*, const char*, bool&> switches[] = {
      {"smooth normals", "N", view.smooth_normals},
      {"shadow", "", view.shadow},
      {"grid", "lines on the ground and on walls\nG", view.grid},
      {"sky and ground", "also walls; without: one colour", view.backdrop},
      {"legend", "with every colour but plain", view.legend},
      {"follow", "the camera goes where the bodies go\nL", view.follow},
      {"contacts", "dots where vertices touch the ground or walls", view.contacts},
      {"arrows", "where velocities take some of the vertices", view.arrows},
      {"probe", "the cursor at rest on a body says what is there", s.probing}};
  for (int i = 0; const auto& [name, help, value] : switches) {
    if (i++ % 2) ImGui::SameLine(label_width());
    check_box(s, name, value, help);
  }
  if (view.arrows)
    slider(s, "arrow length", view.arrow_seconds, 1e-3, 1, "%.3g s",
           "the time a vertex would take along its arrow", true);
  int doublings = std::bit_width(unsigned(s.samples) / 2);
  enum_combo(s, "MSAA", std::array{"none", "2x", "4x", "8x"}, doublings);
  s.samples = doublings ? 1 << doublings : 0;
}

bool section(Session& s, const char* name, bool open = true) {
  const bool shown =
      ImGui::CollapsingHeader(name, open ? ImGuiTreeNodeFlags_DefaultOpen : ImGuiTreeNodeFlags_None);
  mark(s, std::string("section ") + name);
  return shown;
}

}  // namespace

std::string label_of(const char* name) {
  std::string label = name;
  std::ranges::replace(label, '_', ' ');
  return label;
}

float label_width() { return ImGui::GetFontSize() * 9.4f; }

void mark(Session& s, const std::string& name, const Rect& place) {
  if (!s.log.file.is_open()) return;
  Rect& last = s.ui.places[name];
  if (last == place) return;
  last = place;
  s.log("at {} {:.0f} {:.0f} {:.0f} {:.0f}", name, place.x, place.y, place.width, place.height);
}

void mark(Session& s, const std::string& name) {
  if (!s.log.file.is_open() || !ImGui::IsItemVisible()) return;
  const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
  mark(s, name, {low.x, low.y, high.x - low.x, high.y - low.y});
}

void draw_timeline(Session& s) {
  Timeline& t = s.timeline;
  const auto name = [](int halvings) {
    return halvings ? fmt::format("1/{}x", 1 << halvings) : std::string("1x");
  };
  ImGui::SetNextItemWidth(ImGui::GetFontSize() * 4);
  if (ImGui::BeginCombo("##speed", name(s.clock.halvings).c_str())) {
    for (int halvings = 0; halvings <= most_halvings; ++halvings) {
      if (ImGui::Selectable(name(halvings).c_str(), halvings == s.clock.halvings)) change_speed(s, halvings);
      mark(s, "speed=" + name(halvings));
    }
    ImGui::EndCombo();
  }
  describe_item(s, "speed", "of the clock: slow motion\n, and .");
  ImGui::SameLine();
  ImGui::BeginDisabled(t.moments.size() < 2);
  bool looping = t.looping;
  if (ImGui::Checkbox("loop", &looping)) set_looping(s, looping);
  describe_item(s, "loop", "play what is kept again and again");
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-1);
  const double dt = s.loaded.sim().settings.dt;
  const long first = t.moments.empty() ? 0 : t.moments.front()->step;
  long now = steps_of(s.loaded.lanes),
       last = t.moments.empty() ? now : std::max(t.moments.back()->step, first);
  std::string text = t.moments.empty() ? "nothing is kept" : fmt::format("{:.3f} s", double(now) * dt);
  if (!t.moments.empty() && ImGui::GetContentRegionAvail().x > ImGui::GetFontSize() * 15)
    text += fmt::format(" of {:.3f} .. {:.3f} s", double(first) * dt, double(last) * dt);
  if (ImGui::SliderScalar("##time", ImGuiDataType_S64, &now, &first, &last, text.c_str(),
                          ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_NoInput))
    show_step(s, now);
  describe_item(s, "time",
                fmt::format("back and forth in time, of all lanes; to play on from there forgets what came "
                            "after\nLeft and Right: state by state\n{} states are kept, {:.3g} of {} MB: all "
                            "of late, fewer of long ago\n--history-mb",
                            t.moments.size(), double(t.bytes) / 1048576, t.budget >> 20));
  ImGui::EndDisabled();
}

void draw_panel(Session& s) {
  draw_run(s);
  if (section(s, "Scene")) draw_scene(s);
  if (section(s, "Side by side")) draw_lane_rows(s);
  if (section(s, "Stability map", false)) draw_map(s);
  if (section(s, "Solver")) draw_solver(s), draw_material(s), draw_parameters(s, "solver");
  if (section(s, "View")) draw_view(s);
  if (section(s, "World")) draw_parameters(s, "world");
}

}  // namespace tetpbd
