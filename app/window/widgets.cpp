#include "app/window/widgets.h"

#include <imgui_internal.h>

#include <algorithm>
#include <cstdio>

namespace tetpbd {

std::string label_of(const char* name) {
  for (const auto& [parameter, written] : {std::pair<std::string_view, const char*>{"young_modulus", "Young's modulus"},
                                           {"poisson_ratio", "Poisson's ratio"},
                                           {"dt", "time step"}})
    if (name == parameter) return written;
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

ImVec4 alarm(const Session& s) { return s.ui.kept.dark ? ImVec4(1, 0.6f, 0.45f, 1) : ImVec4(0.68f, 0.2f, 0.05f, 1); }
ImVec4 accent(const Session& s) { return s.ui.kept.dark ? ImVec4(0.5f, 0.75f, 1, 1) : ImVec4(0.05f, 0.3f, 0.75f, 1); }

namespace {

bool explain_item(Session& s, const std::string& name, const std::string& help, const std::string& back) {
  if (ImGui::IsItemActive() || !ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) return false;
  ImGui::BeginTooltip();
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 26);
  ImGui::TextUnformatted(help.c_str());
  if (!back.empty()) ImGui::TextColored(accent(s), "right click: back to %s", back.c_str());
  ImGui::PopTextWrapPos();
  ImGui::EndTooltip();
  if (back.empty() || !ImGui::IsMouseClicked(ImGuiMouseButton_Right)) return false;
  s.log("back {} {}", name, back);
  return true;
}

// What is open is the preferences' business, not Dear ImGui's.
bool foldable(Session& s, const char* label, const std::string& name, bool open, auto widget) {
  const auto& kept = s.ui.kept.open;
  if (const auto found = kept.find(name); found != kept.end()) open = found->second;
  ImGui::SetNextItemOpen(open);
  const bool shown = widget(label);
  mark(s, "section " + name);
  if (shown != open) s.ui.kept.open[name] = shown, s.log("{} {}", shown ? "opened" : "folded", name);
  return shown;
}

}  // namespace

bool describe_item(Session& s, const std::string& name, const std::string& help, const std::string& back) {
  mark(s, name);
  return explain_item(s, name, help, back);
}

std::string begin_row(Session& s, const std::string& label, bool unusual) {
  ImGui::BeginGroup();
  ImGui::AlignTextToFramePadding();
  if (unusual) {
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImGui::GetWindowDrawList()->AddCircleFilled(ImVec2(at.x - 4 * s.ui.scale, at.y + ImGui::GetFrameHeight() / 2),
                                                2.5f * s.ui.scale, ImGui::GetColorU32(accent(s)));
  }
  ImGui::PushStyleColor(ImGuiCol_Text, unusual ? accent(s) : ImGui::GetStyleColorVec4(ImGuiCol_Text));
  ImGui::TextUnformatted(label.c_str());
  ImGui::PopStyleColor();
  ImGui::SameLine(label_width());
  ImGui::SetNextItemWidth(-1);
  return "##" + label;
}

bool end_row(Session& s, const std::string& name, const std::string& help, const std::string& back) {
  mark(s, name);
  ImGui::EndGroup();
  return explain_item(s, name, help, back);
}

bool section(Session& s, const char* name, bool open) {
  return foldable(s, name, name, open, [](const char* label) { return ImGui::CollapsingHeader(label); });
}

bool more(Session& s, const std::string& section, bool unusual) {
  ImGui::PushStyleColor(ImGuiCol_Text, unusual ? accent(s) : ImGui::GetStyleColorVec4(ImGuiCol_Text));
  const bool shown = foldable(s, "more", section + " more", false, [&](const char* label) {
    return ImGui::TreeNodeEx((label + ("##" + section)).c_str(),
                             ImGuiTreeNodeFlags_NoTreePushOnOpen | ImGuiTreeNodeFlags_SpanAvailWidth);
  });
  ImGui::PopStyleColor();
  return shown;
}

template <class T>
bool edit_number(Session& s, const std::string& id, const std::string& name, T& value, T low, T high,
                 const std::string& format, bool logarithmic, float speed) {
  constexpr ImGuiDataType type = std::is_same_v<T, double> ? ImGuiDataType_Double : ImGuiDataType_S32;
  const ImGuiID item = ImGui::GetID(id.c_str());
  auto& typed = s.ui.typed;
  const bool was_typed = typed && typed->first == item;
  T shown = was_typed ? T(typed->second) : value;
  const int flags = logarithmic ? ImGuiSliderFlags_Logarithmic : 0;
  const bool edited = speed > 0 ? ImGui::DragScalar(id.c_str(), type, &shown, speed, &low, &high, format.c_str(), flags)
                                : ImGui::SliderScalar(id.c_str(), type, &shown, &low, &high, format.c_str(), flags);
  if (ImGui::TempInputIsActive(item)) {
    typed = {item, double(shown)};
    return false;
  }
  if (was_typed) typed.reset();
  if ((!edited && !was_typed) || shown != shown) return false;  // "nan" was typed
  const T allowed = std::clamp(shown, low, high);
  if (allowed != shown)
    say(s, fmt::format("{} goes from {} to {}: it is {} now", label_of(name.c_str()), low, high, allowed));
  return std::exchange(value, allowed) != allowed;
}
template bool edit_number(Session&, const std::string&, const std::string&, double&, double, double, const std::string&,
                          bool, float);
template bool edit_number(Session&, const std::string&, const std::string&, int&, int, int, const std::string&, bool,
                          float);

bool button(Session& s, const char* label, const char* name, const char* help, float width) {
  const bool pressed = ImGui::Button(label, ImVec2(width, 0));
  describe_item(s, name, help);
  return pressed;
}

bool check_box(Session& s, const char* label, bool& value, const std::string& help, std::optional<bool> usual) {
  const bool unusual = usual && *usual != value, before = value;
  ImGui::PushStyleColor(ImGuiCol_Text, unusual ? accent(s) : ImGui::GetStyleColorVec4(ImGuiCol_Text));
  ImGui::Checkbox(label, &value);
  ImGui::PopStyleColor();
  if (describe_item(s, label, help, !unusual ? "" : *usual ? "on" : "off")) value = *usual;
  if (value != before) s.log("{} {}", label, value);
  return value != before;
}

bool slider(Session& s, const char* label, double& value, double usual, double low, double high, const char* format,
            const char* help, bool logarithmic) {
  const double before = value;
  edit_number(s, begin_row(s, label, value != usual), label, value, low, high, format, logarithmic);
  char shown[64];
  std::snprintf(shown, sizeof shown, format, usual);
  if (end_row(s, label, help, before != usual ? shown : "")) value = usual;
  return value != before;
}

std::optional<std::string> combo(Session& s, const std::string& label, const std::string& now, const Words& words,
                                 const std::string& help, const std::string& usual) {
  std::optional<std::string> chosen;
  const std::string back = now == usual ? "" : usual;
  if (ImGui::BeginCombo(begin_row(s, label, !back.empty()).c_str(), now.c_str(), ImGuiComboFlags_HeightLarge)) {
    for (const std::string& word : words) {
      if (ImGui::Selectable(word.c_str(), word == now)) chosen = word;
      mark(s, label + "=" + word);
    }
    ImGui::EndCombo();
  }
  if (end_row(s, label, help, back)) chosen = back;
  return chosen;
}

}  // namespace tetpbd
