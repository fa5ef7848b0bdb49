// The panel at the right: run, scene, material, solver, contact, view. Widgets of settings are made from
// their rows.
#include <fmt/ranges.h>
#include <imgui.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string_view>
#include <tuple>

#include "app/bodies.h"
#include "app/window/ui.h"
#include "app/window/widgets.h"
#include "sim/contact/surfaces.h"
#include "sim/error.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

template <class T>
bool number_widget(Session& s, const Parameter& row, const std::string& id, T& value) {
  constexpr bool real = std::is_same_v<T, double>;
  // A logarithmic slider takes what its format does not show for 0: it has to hold decades down to 1e-12.
  const std::string number = !real ? "%d" : row.logarithmic ? "%.12g" : "%.4g";
  const std::string format = number + (*row.unit ? " " : "") + row.unit;
  // A linear slider over a wide range cannot be aimed: such a value is dragged, by a part of itself.
  const bool slides = row.logarithmic || row.high - row.low <= 20;
  const float speed = slides ? 0 : real ? 0.01f * std::max(1.0f, std::abs(float(value))) : 1.0f;
  T edited = value;
  if (!edit_number(s, id, row.name, edited, T(row.low), T(row.high), format, row.logarithmic, speed)) return false;
  if (real) edited = T(std::stod(fmt::format("{:.4g}", double(edited))));
  return std::exchange(value, edited) != edited;
}

std::string help_text(const Parameter& row) {
  std::string text = row.help;
  if (row.name == "mode")
    for (const SolverMode& mode : solver_modes()) text += fmt::format("\n{}: {}", mode.name, mode.help);
  if (choices(row).empty() && !std::holds_alternative<bool Settings::*>(row.member))
    text += fmt::format("\n{:g} to {:g}{}{}; Ctrl+click to type", row.low, row.high, *row.unit ? " " : "", row.unit);
  if (row.effect == Effect::restart) text += "\ntakes effect at the next reset";
  return text + fmt::format("\non the command line: {}", flag_name(row));
}

// A row of check boxes for a list of words.
bool words_widget(Session& s, const Parameter& row, std::string& value, const std::string& usual) {
  Words chosen = split(value, ',');
  const Words first = split(usual, ',');
  bool changed = false;
  int place = 0;
  for (const std::string& word : choices(row)) {
    if (place++ % 3) ImGui::SameLine();
    bool on = std::ranges::count(chosen, word) > 0;
    if (!check_box(s, word.c_str(), on, help_text(row), std::ranges::count(first, word) > 0)) continue;
    changed = true;
    on ? chosen.push_back(word) : void(std::erase(chosen, word));
  }
  if (changed) value = fmt::format("{}", fmt::join(chosen, ","));
  return changed;
}

// What has no effect, as the stiffness of a kind that is switched off, is not shown.
bool has_effect(const Session& s, const Settings& settings, const Parameter& row) {
  const std::string_view name = row.name;
  const SolverMode& mode = solver_mode(settings);
  const bool material = settings.material != "none";
  if (name == "mass_splitting") return mode.jacobi && !compliant(settings);  // which brings it with it
  if (name == "acceleration") return mode.accelerates;
  if (name == "omega") return mode.jacobi;
  if (name == "stability" || name == "mass_scaling") return mode.leapfrog;
  if (name == "iterations") return !mode.leapfrog;
  if (name == "rigid_contact") {
    Settings on = settings;
    on.rigid_contact = true;
    return any_moves_rigidly(on);
  }
  if (name == "restitution") return settings.restitution != 0 || any_moves_rigidly(settings);
  if (name == "ground_height") return settings.ground;
  if (name == "contact_distance") return bool(s.loaded.sim().pairs);
  if (name == "friction") return settings.ground || !s.loaded.scene.obstacles.empty();
  if (name == "young_modulus" || name == "poisson_ratio") return material;
  if (name == "element") return settings.material == "neo-hookean" && mode.smoothed;
  if (name == "smoothing") return smoothed(in_mode(settings, settings));
  if (name == "viscosity" || name == "bulk_viscosity" || name == "yield_strain")
    return settings.material == "neo-hookean";
  if (name == "creep_time") return yields(settings);
  if (name == "constraints") return !material;
  const auto* of = std::get_if<KindMember>(&row.member);
  return !of || (!material && uses(settings, constraint_kinds[of->kind]));
}

// Beside the number stands whether the mode or the material decides it; then the number shows what it decided.
template <class T>
void automatic_widget(Session& s, const Parameter& row, const std::string& id, T& value) {
  const Plan& plan = s.loaded.lane().plan();
  const T decided = row.name == "iterations" ? T(plan.iterations)
                    : row.name == "substeps" ? T(plan.substeps)
                    : row.name == "contact_distance"
                        ? T(Surfaces::offset_part * s.loaded.sim().pairs.edge)
                        : T(smoothing_of(settings_for_body(asked_settings(s), s.loaded.body)));
  const float box = ImGui::GetFrameHeight() + ImGui::GetStyle().ItemInnerSpacing.x + ImGui::CalcTextSize("auto").x +
                    ImGui::GetStyle().ItemSpacing.x;
  T shown = value == automatic ? decided : value;
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - box);
  if (number_widget(s, row, id, shown)) value = shown;
  mark(s, row.name + " number");
  ImGui::SameLine();
  bool by_itself = value == automatic;
  if (ImGui::Checkbox(("auto" + id).c_str(), &by_itself)) value = by_itself ? T(automatic) : decided;
  mark(s, row.name + " auto");
}

bool parameter_widget(Session& s, const Parameter& row, Settings& settings) {
  const Settings own = settings_for_body(s.loaded.own, s.loaded.body);
  const std::string usual = parameter_text(own, row), before = parameter_text(settings, row),
                    back = before == usual ? "" : usual;
  if (const auto* word = std::get_if<std::string Settings::*>(&row.member)) {
    std::string& value = settings.**word;
    if (row.name == "constraints") return words_widget(s, row, value, own.**word);
    const auto chosen = combo(s, row.name, value, choices(row), help_text(row), usual);
    if (chosen) set_parameter(settings, row, *chosen, row.name);
    return value != before;
  }
  const std::string id = begin_row(s, label_of(row.name.c_str()), !back.empty());
  with_value(settings, row, [&]<class T>(T& value) {
    if constexpr (std::is_same_v<T, int> || std::is_same_v<T, double>)
      if (row.automatic) return automatic_widget(s, row, id, value);
    if constexpr (std::is_same_v<T, bool>)
      ImGui::Checkbox(id.c_str(), &value);
    else if constexpr (!std::is_same_v<T, std::string>)
      number_widget(s, row, id, value);
  });
  const std::string unit = *row.unit ? std::string(" ") + row.unit : "";
  if (end_row(s, row.name, help_text(row), back.empty() ? "" : back + unit))
    set_parameter(settings, row, back, row.name);
  return parameter_text(settings, row) != before;
}

/// Where settings have their widgets: those that matter at once, others under "more". A * stands for kinds of
/// constraint. What is named nowhere is under the solver's.
struct Group {
  const char* name;
  bool open;
  Words shown, more;
};
const std::vector<Group> groups = {
    {"Material",
     true,
     {"material", "young_modulus", "poisson_ratio", "element", "constraints", "k_*"},
     {"smoothing", "compliance_*", "constraint_damping", "viscosity", "bulk_viscosity", "yield_strain", "creep_time",
      "damping"}},
    {"Solver",
     true,
     {"mode", "substeps", "iterations", "stability", "dt"},
     {"omega", "acceleration", "mass_splitting", "mass_scaling"}},
    {"World", false, {"gravity", "ground"}, {"ground_height"}},
    {"Contact", false, {"contact", "friction", "restitution"}, {"contact_distance", "rigid_contact"}},
};

bool names(const std::string& pattern, const std::string& name) {
  return pattern.back() == '*' ? name.starts_with(pattern.substr(0, pattern.size() - 1)) : name == pattern;
}

// What the panel shows is of all bodies or of the chosen one.
Settings shown_settings(const Session& s) { return settings_for_body(asked_settings(s), s.loaded.body); }
void change_shown(Session& s, const Settings& wanted) {
  if (!s.loaded.body) return change_settings(s, wanted);
  change_settings(s, with_body_changed(asked_settings(s), wanted, *s.loaded.body, s.loaded.model->bodies.size()));
}

void draw_settings(Session& s, const Group& group) {
  const Settings now = shown_settings(s), own = settings_for_body(s.loaded.own, s.loaded.body);
  const auto differs = [](const Settings& a, const Settings& b, const Parameter& row) {
    return parameter_text(a, row) != parameter_text(b, row);
  };
  std::vector<const Parameter*> shown, rest;
  const auto put = [&](const Parameter& row, bool matters) {
    // What the scene itself sets matters there.
    matters = matters || differs(own, Settings(), row);
    if (has_effect(s, now, row)) (matters ? shown : rest).push_back(&row);
  };
  for (const Words* list : {&group.shown, &group.more})
    for (const std::string& pattern : *list)
      for (const Parameter& row : parameters())
        if (names(pattern, row.name)) put(row, list == &group.shown);
  for (const Parameter& row : parameters()) {
    const auto named = [&](const std::string& pattern) { return names(pattern, row.name); };
    if (&group == &groups[1] && std::ranges::none_of(groups, [&](const Group& g) {
          return std::ranges::any_of(g.shown, named) || std::ranges::any_of(g.more, named);
        }))
      put(row, false);
  }
  Settings wanted = now;
  bool changed = false;
  for (const Parameter* row : shown) changed |= parameter_widget(s, *row, wanted);
  const bool unusual = std::ranges::any_of(rest, [&](const auto* row) { return differs(now, own, *row); });
  if (!rest.empty() && more(s, group.name, unusual))
    for (const Parameter* row : rest) changed |= parameter_widget(s, *row, wanted);
  if (changed) change_shown(s, wanted);
}

// A choice among presets; `current`: the one that is set, if any.
struct Ways {
  std::string current = "custom", help;
  Words words;
  std::map<std::string, Settings> to{};
};
Ways ways_of(const Settings& now, const std::vector<Preset>& presets, const std::string& help) {
  Ways ways{.help = help, .words = preset_names(presets)};
  for (const Preset& preset : presets) {
    apply_preset(ways.to[preset.name] = now, presets, preset.name);
    if (ways.to[preset.name] == now) ways.current = preset.name;
    ways.help += fmt::format("\n{}: {}", preset.name, preset.help);
  }
  return ways;
}

// The whole way to solve by one word, and what auto picked.
void draw_solver(Session& s) {
  const Settings now = asked_settings(s);
  const auto& choice = s.loaded.choice;
  const bool automatic = choice && choice->settings() == now;
  Ways ways = ways_of(
      now, solver_presets(),
      "solver preset: sets mode, substeps and iterations at once\nauto: tries solvers on this scene and takes the "
      "most accurate within the budget");
  ways.help += "\non the command line: --solver";
  if (automatic) ways.current = "auto";
  ways.words.push_back("auto");
  if (const auto chosen = combo(s, "solver", ways.current, ways.words, ways.help))
    ways.to.contains(*chosen) ? change_settings(s, ways.to[*chosen]) : choose_soon(s);
  const AdaptiveValues& watch = s.loaded.lane().adaptive();
  if (solver_mode(now).leapfrog)
    ImGui::TextWrapped(
        "%d substeps%s", s.loaded.lane().plan().substeps,
        watch.stiffening > 1 ? fmt::format(", {:.2g} times as many as at rest", watch.stiffening).c_str() : "");
  if (solver_mode(now).implicit)
    ImGui::TextWrapped(
        "%s", fmt::format("residual {:.2g} %, step health {:.2f} (1 = good){}", 100 * double(watch.residual),
                          double(watch.health),
                          watch.substep_factor > 1
                              ? fmt::format("; inverted tets or contact: {} x the substeps", watch.substep_factor)
                              : "")
                  .c_str());
  const auto more_shown = s.ui.kept.open.find("Solver more");
  if (!automatic && (more_shown == s.ui.kept.open.end() || !more_shown->second)) return;
  if (slider(s, "budget of auto", s.budget_ms, 0.5, 0.01, 100, "%.3g ms per step",
             "time that a step may take: once auto has chosen, it chooses again when you let go\non the command line: "
             "--budget-ms",
             true))
    s.ui.rebudget = automatic;
  if (s.ui.rebudget && !ImGui::IsAnyItemActive()) s.ui.rebudget = false, choose_soon(s);
  if (automatic) ImGui::TextWrapped("%s", describe(*choice).c_str());
}

// Which body the panel is of.
void draw_body_choice(Session& s) {
  const auto& bodies = s.loaded.model->bodies;
  if (bodies.size() < 2) return;
  const std::string all = has_own_materials(s.loaded.sim().settings) ? "all without their own" : "all";
  Words words = {all};
  for (const Body& body : bodies) words.push_back(fmt::format("{} {}", body.number, body.name));
  const std::size_t now = s.loaded.body ? *s.loaded.body + 1 : 0;
  const std::string help = "whose material, friction and restitution are shown and changed\nB: the one under the mouse";
  if (const auto chosen = combo(s, "body", words[now], words, help)) {
    const auto at = std::size_t(std::ranges::find(words, *chosen) - words.begin());
    choose_body(s, at > 0 ? std::optional(at - 1) : std::nullopt);
  }
}

// What the body is made of, by name; its numbers are below.
void draw_material(Session& s) {
  draw_body_choice(s);
  Ways ways = ways_of(shown_settings(s), material_presets(),
                      "a material by name, with its stiffness; for bodies that are to be soft");
  if (const auto chosen = combo(s, "preset", ways.current, ways.words, ways.help)) change_shown(s, ways.to[*chosen]);
}

// Of several bodies: which are seen, and which one the panel is of.
void draw_bodies(Session& s) {
  const auto& bodies = s.loaded.model->bodies;
  constexpr std::size_t most = 8;  // rows, beyond which the list scrolls
  const float row = ImGui::GetFrameHeightWithSpacing();
  ImGui::BeginChild("bodies", ImVec2(0, row * float(std::min(bodies.size(), most))));
  for (const Body& body : bodies) {
    bool seen = body.number >= s.loaded.hidden.size() || !s.loaded.hidden[body.number];
    if (ImGui::Checkbox(fmt::format("##seen {}", body.number).c_str(), &seen)) hide_body(s, body.number, !seen);
    describe_item(s, fmt::format("seen {}", body.number), "shown in the view; it is solved all the same\nU");
    ImGui::SameLine();
    const bool chosen = s.loaded.body == body.number;
    const std::string name = fmt::format(
        "{}, {}##body {}", body.name,
        body.is_sheet() ? fmt::format("{} triangles", body.triangles) : fmt::format("{} tets", body.tets), body.number);
    if (ImGui::Selectable(name.c_str(), chosen)) choose_body(s, chosen ? std::nullopt : std::optional(body.number));
    describe_item(s, fmt::format("body {}", body.number), "the panel shows and changes its material and friction\nB");
  }
  ImGui::EndChild();
}

void draw_run(Session& s) {
  const float gap = ImGui::GetStyle().ItemSpacing.x, width = (ImGui::GetContentRegionAvail().x - 2 * gap) / 3;
  if (button(s, s.playing ? "Pause##play" : "Play##play", "play", "start and stop the clock\nSpace", width))
    play(s, !s.playing);
  ImGui::SameLine();
  if (button(s, "Step", "step", "one step of dt, then stop\nS", width)) single_step(s);
  ImGui::SameLine();
  if (button(s, "Reset", "reset", "all bodies to where they began; settings stay\nR", width)) restart(s);
}

void draw_lane_rows(Session& s) {
  const auto& lanes = s.loaded.lanes;
  const std::string help =
      "the same bodies solved in several ways at once: pull one and all are pulled; the panel is of the "
      "chosen lane";
  Ways ways{.help = help, .words = {}};
  for (const Comparison& row : comparisons())
    ways.words.push_back(row.name), ways.help += fmt::format("\n{}: {}", row.name, row.help);
  if (const auto name = combo(s, "side by side", lanes.size() > 1 ? "custom" : "single", ways.words, ways.help))
    compare_lanes(s, std::ranges::find(comparisons(), *name, &Comparison::name)->lanes);
  const float gap = ImGui::GetStyle().ItemSpacing.x, width = (ImGui::GetContentRegionAvail().x - gap) / 2;
  if (button(s, "Add a lane", "add lane",
             "the same bodies once more, to compare: soft ones first by a solver that converges; settings to change\nK",
             width))
    add_lane(s);
  ImGui::SameLine();
  if (lanes.size() < 2) return ImGui::NewLine();
  if (button(s, "Remove this one", "remove lane", "the chosen lane goes, the others start anew\nJ: the last one",
             width))
    return remove_lane(s, s.loaded.chosen);
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const glm::vec3 colour = lane_colour(i);
    ImGui::ColorButton(fmt::format("##colour {}", i).c_str(), ImVec4(colour.x, colour.y, colour.z, 1),
                       ImGuiColorEditFlags_NoTooltip);
    ImGui::SameLine();
    if (ImGui::Selectable(fmt::format("{}##lane {}", describe(lanes[i]), i).c_str(), i == s.loaded.chosen))
      choose_lane(s, i);
    describe_item(s, fmt::format("lane {}", i + 1),
                  "settings, time per step and colours are those of the lane that is chosen");
  }
  check_box(s, "overlaid", s.overlaid, "all lanes in one place, in their colours\nO", false);
  ImGui::SameLine(label_width());
  check_box(s, "ghost", s.ghost, "in each lane, grey, the one that is nearest to the reference motion", true);
}

}  // namespace

void draw_timeline(Session& s) {
  Timeline& t = s.timeline;
  const auto name = [](int halvings) { return halvings ? fmt::format("1/{}x", 1 << halvings) : std::string("1x"); };
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
  describe_item(s, "loop", "replay the stored motion in a loop");
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-1);
  const long first = t.moments.empty() ? 0 : t.moments.front()->step;
  long now = steps_of(s.loaded.lanes), last = t.moments.empty() ? now : std::max(t.moments.back()->step, first);
  std::string text = t.moments.empty() ? "nothing is stored" : fmt::format("{:.3f} s", s.loaded.lane().time());
  if (!t.moments.empty() && ImGui::GetContentRegionAvail().x > ImGui::GetFontSize() * 15)
    text += fmt::format(" of {:.3f} .. {:.3f} s", t.moments.front()->time,
                        std::max(t.moments.back()->time, s.loaded.lane().time()));
  if (ImGui::SliderScalar("##time", ImGuiDataType_S64, &now, &first, &last, text.c_str(),
                          ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_NoInput))
    between_steps(s, [&s, now] { show_step(s, now); });
  describe_item(s, "time",
                fmt::format("move all lanes in time; playing from here discards later states\nLeft and Right: state by "
                            "state\n{} states are stored, {:.3g} of {} MB: all recent ones, fewer of the older\n"
                            "--history-mb",
                            t.moments.size(), double(t.bytes) / 1048576, t.budget >> 20));
  ImGui::EndDisabled();
}

void draw_panel(Session& s) {
  draw_run(s);
  if (section(s, "Side by side", false)) draw_lane_rows(s);
  if (section(s, "Stability map", false)) draw_map(s);
  if (section(s, "Scene")) draw_scene(s);
  if (s.loaded.model->bodies.size() > 1 && section(s, "Bodies", false)) draw_bodies(s);
  for (const Group& group : groups) {
    if (!section(s, group.name, group.open)) continue;
    if (group.name == std::string_view("Material")) draw_material(s);
    if (group.name == std::string_view("Solver")) draw_solver(s);
    draw_settings(s, group);
  }
  if (section(s, "Obstacles", !s.loaded.scene.obstacles.empty())) draw_obstacles(s);
  if (section(s, "View")) draw_view(s);
}

}  // namespace tetpbd
