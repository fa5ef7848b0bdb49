// The panel at the right: run, scene, solver, world, view. Widgets of parameters are made from their rows.
#include <fmt/ranges.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "app/ui.h"

namespace tetpbd {

namespace {

std::string label_of(const char* name) {
  std::string label = name;
  std::replace(label.begin(), label.end(), '_', ' ');
  return label;
}

void tooltip(const std::string& text) {
  if (text.empty() || ImGui::IsItemActive() || !ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled))
    return;
  ImGui::BeginTooltip();
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 24);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopTextWrapPos();
  ImGui::EndTooltip();
}

// Label at the left, the widget in the rest of the line.
void begin_row(const char* label) {
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(label);
  ImGui::SameLine(ImGui::GetFontSize() * 9.4f);  // "compliance stretch" fits
  ImGui::SetNextItemWidth(-1);
}

template <class T>
bool number_widget(const Parameter& row, T& value, ImGuiDataType type) {
  const T low = T(row.low), high = T(row.high);
  const std::string id = fmt::format("##{}", row.name);
  const std::string format =
      (type == ImGuiDataType_Double ? "%.4g" : "%d") + std::string(*row.unit ? " " : "") + row.unit;
  // A linear slider over a wide range cannot be aimed: such a value is dragged, by a part of itself.
  if (!row.logarithmic && row.high - row.low > 20) {
    const float speed = type == ImGuiDataType_Double ? 0.01f * std::max(1.0f, std::abs(float(value))) : 1.0f;
    return ImGui::DragScalar(id.c_str(), type, &value, speed, &low, &high, format.c_str(),
                             ImGuiSliderFlags_AlwaysClamp);
  }
  if (row.logarithmic && row.low == 0 && type == ImGuiDataType_Double) {
    // ImGui takes what its format does not show for 0: all decades down to 1e-12 have to be in it.
    const std::string all = "%.12g" + (*row.unit ? " " + std::string(row.unit) : "");
    const bool changed = ImGui::SliderScalar(id.c_str(), type, &value, &low, &high, all.c_str(),
                                             ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_Logarithmic);
    if (changed) value = T(std::stod(fmt::format("{:.3g}", double(value))));
    return changed;
  }
  const int flags = ImGuiSliderFlags_AlwaysClamp | (row.logarithmic ? ImGuiSliderFlags_Logarithmic : 0);
  return ImGui::SliderScalar(id.c_str(), type, &value, &low, &high, format.c_str(), flags);
}

std::string help_text(const Parameter& row) {
  std::string text = row.help;
  if (choices(row).empty() && !std::holds_alternative<bool Settings::*>(row.member))
    text += fmt::format("\n{:g} to {:g}{}{}; Ctrl+click to type", row.low, row.high, *row.unit ? " " : "",
                        row.unit);
  if (row.effect == Effect::restart) text += "\ntakes effect at the next reset";
  return text + fmt::format("\n{}", flag_name(row));
}

// A list of words is a row of check boxes, one word a combo.
bool words_widget(Session& s, Ui& ui, const Parameter& row, std::string& value) {
  const auto allowed = choices(row);
  bool changed = false;
  if (std::string_view(row.name) != "constraints") {
    begin_row(label_of(row.name).c_str());
    if (ImGui::BeginCombo(fmt::format("##{}", row.name).c_str(), value.c_str())) {
      for (const std::string& word : allowed) {
        if (ImGui::Selectable(word.c_str(), word == value)) value = word, changed = true;
        mark(s, ui, fmt::format("{}={}", row.name, word));
      }
      ImGui::EndCombo();
    }
    tooltip(help_text(row));
    mark(s, ui, row.name);
    return changed;
  }
  auto chosen = split(value, ',');
  for (std::size_t i = 0; i < allowed.size(); ++i) {
    bool on = std::find(chosen.begin(), chosen.end(), allowed[i]) != chosen.end();
    if (i) {
      const float needed = ImGui::CalcTextSize(allowed[i].c_str()).x + 2 * ImGui::GetFrameHeight();
      ImGui::SameLine();
      if (ImGui::GetContentRegionAvail().x < needed) ImGui::NewLine();
    }
    if (ImGui::Checkbox(allowed[i].c_str(), &on)) {
      changed = true;
      if (on)
        chosen.push_back(allowed[i]);
      else
        std::erase(chosen, allowed[i]);
    }
    tooltip(help_text(row));
    mark(s, ui, allowed[i]);
  }
  if (changed) value = fmt::format("{}", fmt::join(chosen, ","));
  return changed;
}

// A stiffness of a kind that is switched off has no effect.
bool is_idle(const Settings& settings, const Parameter& row) {
  const std::string_view name = row.name;
  if (name == "mass_splitting") return compliant(settings);  // brings it with it
  for (const std::string_view of_kind : {"k_", "compliance_"})
    if (name.starts_with(of_kind)) {
      const auto kinds = split(settings.constraints, ',');
      return std::find(kinds.begin(), kinds.end(), name.substr(of_kind.size())) == kinds.end();
    }
  return false;
}

bool parameter_widget(Session& s, Ui& ui, const Parameter& row, Settings& settings) {
  if (const auto* word = std::get_if<std::string Settings::*>(&row.member))
    return words_widget(s, ui, row, settings.**word);
  ImGui::BeginDisabled(is_idle(settings, row));
  bool changed = false;
  begin_row(label_of(row.name).c_str());
  if (const auto* member = std::get_if<double Settings::*>(&row.member))
    changed = number_widget(row, settings.**member, ImGuiDataType_Double);
  if (const auto* member = std::get_if<int Settings::*>(&row.member))
    changed = number_widget(row, settings.**member, ImGuiDataType_S32);
  if (const auto* member = std::get_if<bool Settings::*>(&row.member))
    changed = ImGui::Checkbox(fmt::format("##{}", row.name).c_str(), &(settings.**member));
  tooltip(help_text(row));
  mark(s, ui, row.name);
  ImGui::EndDisabled();
  return changed;
}

void draw_parameters(Session& s, Ui& ui, std::string_view section) {
  Settings wanted = s.loaded.sim.settings;
  bool changed = false;
  for (const Parameter& row : parameters())
    if (section == row.section) changed |= parameter_widget(s, ui, row, wanted);
  if (changed) change_settings(s, wanted);
}

const SolverPreset* preset_of(const Settings& settings) {
  for (const SolverPreset& preset : solver_presets()) {
    Settings same = settings;
    apply_preset(same, preset);
    if (same == settings) return &preset;
  }
  return nullptr;
}

// The whole way to solve by one word, and what auto picked.
void draw_solver(Session& s, Ui& ui) {
  const Settings& now = s.loaded.sim.settings;
  const SolverPreset* preset = preset_of(now);
  const auto& choice = s.loaded.choice;
  const bool chosen = choice && choice->settings() == now;
  begin_row("solver");
  if (ImGui::BeginCombo("##solver", chosen ? "auto" : preset ? preset->name : "as set below")) {
    for (const SolverPreset& row : solver_presets()) {
      if (ImGui::Selectable(row.name, !chosen && preset == &row)) {
        Settings wanted = now;
        apply_preset(wanted, row);
        change_settings(s, wanted);
      }
      tooltip(row.help);
      mark(s, ui, fmt::format("solver={}", row.name));
    }
    if (ImGui::Selectable("auto", chosen)) s.choosing = true;
    tooltip("tries ways to solve this scene and takes what loses least volume within the budget");
    mark(s, ui, "solver=auto");
    ImGui::EndCombo();
  }
  tooltip("a way to solve, by name\n--solver");
  mark(s, ui, "solver");
  if (!chosen) return;
  begin_row("budget");
  const double low = 0.01, high = 100;
  ImGui::SliderScalar("##budget", ImGuiDataType_Double, &s.budget_ms, &low, &high, "%.3g ms a step",
                      ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_Logarithmic);
  if (ImGui::IsItemDeactivatedAfterEdit()) s.choosing = true;
  tooltip("GPU time that a step may take; choosing again takes a second or so\n--budget-ms");
  mark(s, ui, "budget");
  ImGui::TextWrapped("%s", describe(*choice).c_str());
}

void draw_run(Session& s, Ui& ui) {
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  const ImVec2 size((ImGui::GetContentRegionAvail().x - 2 * gap) / 3, ImGui::GetFrameHeight() * 1.25f);
  ImGui::PushStyleColor(ImGuiCol_Button, ImVec4(0.18f, 0.42f, 0.60f, 1));
  ImGui::PushStyleColor(ImGuiCol_ButtonHovered, ImVec4(0.23f, 0.49f, 0.68f, 1));
  ImGui::PushStyleColor(ImGuiCol_ButtonActive, ImVec4(0.14f, 0.36f, 0.53f, 1));
  ImGui::PushStyleColor(ImGuiCol_Text, ImVec4(1, 1, 1, 1));
  if (ImGui::Button(s.playing ? "Pause##play" : "Play##play", size)) play(s, !s.playing);
  mark(s, ui, "play");
  ImGui::PopStyleColor(4);
  tooltip("Space");
  ImGui::SameLine(0, gap);
  if (ImGui::Button("Step", size)) single_step(s);
  mark(s, ui, "step");
  tooltip("S or Right");
  ImGui::SameLine(0, gap);
  if (ImGui::Button("Reset", size)) restart(s);
  mark(s, ui, "reset");
  tooltip("R");
  ImGui::Checkbox("as fast as possible", &s.clock.fast);
  tooltip("steps as often as the machine can, instead of in real time");
  mark(s, ui, "fast");
  ImGui::SameLine(0, 2 * gap);
  ImGui::Checkbox("vsync", &s.vsync);
  tooltip("draw as often as the display shows");
  mark(s, ui, "vsync");
}

void draw_scene(Session& s, Ui& ui) {
  begin_row("scene");
  if (ImGui::BeginCombo("##scene", s.loaded.scene.name.c_str(), ImGuiComboFlags_HeightLarge)) {
    for (const std::string& name : scene_names()) {
      if (ImGui::Selectable(name.c_str(), name == s.loaded.name))
        s.loading = LoadRequest{name, {}, false, false};
      mark(s, ui, "scene=" + name);
    }
    ImGui::EndCombo();
  }
  tooltip(s.loaded.scene.description);
  mark(s, ui, "scene");
  begin_row("mesh file");
  const float button = ImGui::CalcTextSize("Load").x + 2 * ImGui::GetStyle().FramePadding.x;
  ImGui::SetNextItemWidth(-button - ImGui::GetStyle().ItemSpacing.x);
  bool load_it =
      ImGui::InputTextWithHint("##mesh", "path, Enter", &ui.mesh, ImGuiInputTextFlags_EnterReturnsTrue);
  tooltip("in place of the scene's first body: .ply .obj .stl .off surfaces, .node/.ele .msh tetrahedra");
  mark(s, ui, "mesh");
  ImGui::SameLine();
  load_it |= ImGui::Button("Load");
  mark(s, ui, "load");
  if (!load_it || ui.mesh.empty()) return;
  LoadRequest request{s.loaded.name, s.loaded.overrides, true, false};
  request.overrides.mesh = ui.mesh;
  s.loading = request;
}

template <class Names>
bool name_combo(Session& s, Ui& ui, const char* label, const Names& names, int& index) {
  bool changed = false;
  begin_row(label);
  if (ImGui::BeginCombo(fmt::format("##{}", label).c_str(), names[std::size_t(index)])) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (ImGui::Selectable(names[i], int(i) == index)) index = int(i), changed = true;
      mark(s, ui, fmt::format("{}={}", label, names[i]));
    }
    ImGui::EndCombo();
  }
  mark(s, ui, label);
  return changed;
}

void fraction(Session& s, Ui& ui, const char* label, double& value, double high, const char* help) {
  begin_row(label);
  const double low = 0;
  ImGui::SliderScalar(fmt::format("##{}", label).c_str(), ImGuiDataType_Double, &value, &low, &high, "%.2f",
                      ImGuiSliderFlags_AlwaysClamp);
  tooltip(help);
  mark(s, ui, label);
}

void draw_colour_range(Session& s, Ui& ui) {
  ViewOptions& view = s.view;
  if (view.colour == Colour::plain) {
    begin_row("body colour");
    ImGui::ColorEdit3("##body colour", &view.body_colour.x, ImGuiColorEditFlags_NoInputs);
    return;
  }
  begin_row("colour range");
  if (view.colour == Colour::velocity) {
    float high = float(view.velocity.high);
    if (ImGui::SliderFloat("##range", &high, 0.1f, 50, "0 .. %.2f m/s",
                           ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp))
      view.velocity = {0, double(high)};
  } else {
    ColourRange& range = view.colour == Colour::volume ? view.volume : view.stretch;
    float percent = float(range.high * 100);
    if (ImGui::SliderFloat("##range", &percent, 0.1f, 100, "+/- %.1f %%",
                           ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp))
      range = {-double(percent) / 100, double(percent) / 100};
  }
  mark(s, ui, "colour range");
}

void draw_view(Session& s, Ui& ui) {
  ViewOptions& view = s.view;
  int look = int(view.look), colour = int(view.colour);
  if (name_combo(s, ui, "look", look_names, look))
    view.look = Look(look), s.log("look {}", look_names[std::size_t(look)]);
  if (name_combo(s, ui, "colour", colour_names, colour))
    view.colour = Colour(colour), s.log("colour {}", colour_names[std::size_t(colour)]);
  draw_colour_range(s, ui);
  if (view.look == Look::tets) {
    fraction(s, ui, "shrink", view.shrink, 1, "each tetrahedron, towards its centre");
    fraction(s, ui, "explode", view.explode, 3, "tetrahedra away from the bodies' centre");
    fraction(s, ui, "cut", view.cut, 1, "show tetrahedra below this part of the body; 1 shows all");
    begin_row("cut along");
    for (int axis = 0; axis < 3; ++axis) {
      if (axis) ImGui::SameLine();
      ImGui::RadioButton(axis == 0 ? "x" : axis == 1 ? "y" : "z", &view.cut_axis, axis);
    }
  }
  const float column = ImGui::GetContentRegionAvail().x / 2 + ImGui::GetCursorPosX();
  ImGui::Checkbox("smooth normals", &view.smooth_normals);
  mark(s, ui, "normals");
  ImGui::SameLine(column);
  ImGui::Checkbox("shadow", &view.shadow);
  mark(s, ui, "shadow");
  ImGui::Checkbox("grid", &view.grid);
  ImGui::Checkbox("sky and ground", &view.backdrop);
  mark(s, ui, "grid");
  ImGui::SameLine(column);
  ImGui::Checkbox("legend", &view.legend);
  mark(s, ui, "legend");
  constexpr std::array sample_names{"none", "2x", "4x", "8x"};
  int index = s.samples >= 8 ? 3 : s.samples >= 4 ? 2 : s.samples >= 2 ? 1 : 0;
  if (name_combo(s, ui, "MSAA", sample_names, index)) s.samples = index ? 1 << index : 0;
}

bool section(Session& s, Ui& ui, const char* name, bool open) {
  ImGui::Dummy(ImVec2(0, ImGui::GetStyle().ItemSpacing.y * 0.2f));
  const bool shown = ImGui::CollapsingHeader(name, open ? ImGuiTreeNodeFlags_DefaultOpen : 0);
  mark(s, ui, std::string("section ") + name);
  return shown;
}

}  // namespace

void mark(Session& s, Ui& ui, const std::string& name, const Rect& place) {
  if (!s.log.file.is_open()) return;
  Rect& last = ui.places[name];
  if (last == place) return;
  last = place;
  s.log("at {} {:.0f} {:.0f} {:.0f} {:.0f}", name, place.x, place.y, place.width, place.height);
}

void mark(Session& s, Ui& ui, const std::string& name) {
  if (!s.log.file.is_open() || !ImGui::IsItemVisible()) return;
  const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
  mark(s, ui, name, {low.x, low.y, high.x - low.x, high.y - low.y});
}

void draw_panel(Session& s, Ui& ui, const Rect& place) {
  ImGui::SetNextWindowPos(ImVec2(place.x, place.y));
  ImGui::SetNextWindowSize(ImVec2(place.width, place.height));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::Begin("panel", nullptr,
               (ImGuiWindowFlags_NoDecoration & ~ImGuiWindowFlags_NoScrollbar) | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoBringToFrontOnFocus);
  draw_edge(place, place.x, place.y + place.height);
  draw_run(s, ui);
  if (section(s, ui, "Scene", true)) draw_scene(s, ui);
  if (section(s, ui, "Solver", true)) draw_solver(s, ui), draw_parameters(s, ui, "solver");
  if (section(s, ui, "View", true)) draw_view(s, ui);
  if (section(s, ui, "World", true)) draw_parameters(s, ui, "world");
  ImGui::End();
  ImGui::PopStyleVar();
}

}  // namespace tetpbd
