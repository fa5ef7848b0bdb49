// The stability map in the panel: over two settings, the error of the chosen lane's bodies; a click
// takes a cell's.
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>

#include "app/window/ui.h"
#include "app/window/widgets.h"

namespace tetpbd {

namespace {

// What decides most in such a mode.
std::pair<const char*, const char*> usual_axes(const Settings& settings) {
  if (solver_mode(settings).leapfrog) return {"stability=0.2:1:8", "dt=0.001,0.002,0.005,0.01,0.02"};
  if (solver_mode(settings).implicit) return {"iterations=1,2,4,8,16", "dt=0.001,0.002,0.005,0.01,0.02"};
  if (any_material(settings, compliant)) return {"iterations=1,2,4,8,16", "substeps=1,2,5,10,20"};
  return {"omega=0.5:4:8", "substeps=1,2,5,10,20"};
}

std::string words_of(const LiveMap& map, const MapCell& cell) {
  if (cell.state == MapCell::failed) return fmt::format("not finite at step {}", cell.failed_at);
  if (cell.state == MapCell::refused) return cell.why;
  if (cell.state == MapCell::finished)
    return fmt::format("{:.3g} % {}", cell.percent, map.motion ? "from the reference motion" : "of volume lost");
  return cell.state == MapCell::running || !map.search ? "not yet" : "its reference motion is being found";
}

void draw_grid(Session& s, const LiveMap& map) {
  const std::size_t columns = map.x.values.size(), rows = map.y.values.size();
  const float line = ImGui::GetTextLineHeight(), whole = ImGui::GetContentRegionAvail().x;
  float labels = 0;
  for (const std::string& value : map.y.values) labels = std::max(labels, ImGui::CalcTextSize(value.c_str()).x + 6);
  const float wide = (whole - labels) / float(columns), high = std::clamp(wide, 1.3f * line, 2.2f * line);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const ImU32 ink = ImGui::GetColorU32(ImGuiCol_Text);
  const auto write = [&](const std::string& text, float x, float y, ImU32 colour, float room) {
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    if (size.x < room) draw.AddText(ImVec2(x - size.x / 2, y - size.y / 2), colour, text.c_str());
  };
  const Settings& own = s.loaded.sim().settings;
  for (std::size_t row = 0; row < rows; ++row) {
    const float top = corner.y + float(rows - 1 - row) * high;
    write(map.y.values[row], corner.x + labels / 2, top + high / 2, ink, labels + 1);
    for (std::size_t column = 0; column < columns; ++column) {
      const MapCell& cell = map.cells[row * columns + column];
      const ImVec2 low(corner.x + labels + float(column) * wide, top), end(low.x + wide - 1, top + high - 1);
      ImGui::SetCursorScreenPos(low);
      const std::string id = fmt::format("map {} {}", column + 1, row + 1);
      if (ImGui::InvisibleButton(id.c_str(), ImVec2(wide, high))) {
        Settings wanted = own;
        assign(wanted, map.x.row->name, map.x.values[column], "across");
        assign(wanted, map.y.row->name, map.y.values[row], "up");
        s.log("map chose {} {}", map.x.values[column], map.y.values[row]);
        change_settings(s, wanted);
      }
      mark(s, id);
      const bool bad = cell.state == MapCell::failed || cell.state == MapCell::refused;
      const double part = heat_part(cell.percent);
      const glm::vec3 c(bad ? glm::dvec3(0.2) : cell.state == MapCell::finished ? heat(part) : glm::dvec3(0.8));
      draw.AddRectFilled(low, end, ImGui::GetColorU32(ImVec4(c.x, c.y, c.z, 1)));
      const bool dark = bad || (cell.state == MapCell::finished && (part < 0.45 || part > 0.93));
      const std::string said = cell.state == MapCell::running ? "..."
                               : cell.state == MapCell::finished
                                   ? fmt::format(fmt::runtime(cell.percent < 9.5 ? "{:.1g}" : "{:.0f}"), cell.percent)
                               : cell.state == MapCell::failed  ? fmt::format("@{}", cell.failed_at)
                               : cell.state == MapCell::refused ? "no"
                                                                : "";
      write(said, (low.x + end.x) / 2, (low.y + end.y) / 2, dark ? IM_COL32_WHITE : IM_COL32(30, 30, 30, 255), wide);
      if (parameter_text(own, *map.x.row) == parameter_text(cell.settings, *map.x.row) &&
          parameter_text(own, *map.y.row) == parameter_text(cell.settings, *map.y.row))
        draw.AddRect(low, end, ink, 0, 0, 2 * s.ui.scale);  // the lane's own
      if (ImGui::IsItemHovered())
        ImGui::SetTooltip("%s %s, %s %s: %s", map.x.row->name.c_str(), map.x.values[column].c_str(),
                          map.y.row->name.c_str(), map.y.values[row].c_str(), words_of(map, cell).c_str());
    }
  }
  const float below = corner.y + float(rows) * high;
  for (std::size_t column = 0; column < columns; ++column)
    write(map.x.values[column], corner.x + labels + (float(column) + 0.5f) * wide, below + line / 2, ink, wide);
  ImGui::SetCursorScreenPos(ImVec2(corner.x, below + line));
  ImGui::Dummy(ImVec2(whole, 1));
  ImGui::TextWrapped("%s over %s: %s, %%; @: the step at which it fails", label_of(map.y.row->name.c_str()).c_str(),
                     label_of(map.x.row->name.c_str()).c_str(),
                     map.motion ? "distance from the reference motion" : "largest loss of volume");
}

}  // namespace

void draw_map(Session& s) {
  MapWords& words = s.ui.map;
  if (!words.typed) std::tie(words.x, words.y) = usual_axes(s.loaded.sim().settings);
  for (const auto& [label, text] : {std::pair("across", &words.x), {"up", &words.y}}) {
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(label);
    ImGui::SameLine(ImGui::GetFontSize() * 4);
    ImGui::SetNextItemWidth(-1);
    words.typed |= ImGui::InputText(fmt::format("##{}", label).c_str(), text, ImGuiInputTextFlags_AutoSelectAll);
    mark(s, std::string("map ") + label);
    if (ImGui::IsItemHovered() && !ImGui::IsItemActive())
      ImGui::SetTooltip("PARAMETER=1,2,5 or PARAMETER=FROM:TO:COUNT, as tetpbd map takes them");
  }
  auto& map = s.loaded.map;
  const bool filling = map && !map->is_done();
  if (button(s, filling ? "Stop##map" : "Fill the map##map", "fill map",
             "runs the first second of these bodies for each pair of values, beside all else;\na click on a "
             "cell gives its values to the chosen lane",
             -1)) {
    if (filling) {
      map.reset();
      s.log("map stopped");
    } else {
      forget_errors(s);
      attempt(s, [&] {
        map.reset();
        map = start_map(s.loaded.sim().model, s.loaded.sim().settings, words.x, words.y,
                        std::min(s.loaded.scene.duration, 1.0));
        s.log("map of {} cells", map->cells.size());
      });
    }
  }
  if (map) draw_grid(s, *map);
}

}  // namespace tetpbd
