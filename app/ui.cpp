// Around the panel: plots, status line, messages, help, and how the window is shared out.
#include "app/ui.h"

#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>

namespace tetpbd {

namespace {

constexpr ImGuiWindowFlags fixed_window =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
    ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoFocusOnAppearing;

void set_look(Session& s, Look look) {
  s.view.look = look;
  s.log("look {}", look_names[std::size_t(look)]);
}

void begin_fixed(const char* name, const Rect& place) {
  ImGui::SetNextWindowPos(ImVec2(place.x, place.y));
  ImGui::SetNextWindowSize(ImVec2(place.width, place.height));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::Begin(name, nullptr, fixed_window);
  draw_edge(place, place.x + place.width, place.y);
}

void end_fixed() {
  ImGui::End();
  ImGui::PopStyleVar();
}

// 1, 2 or 5 times a power of ten, not below the value.
float rounded_up(float value) {
  const float power = std::pow(10.0f, std::floor(std::log10(std::max(value, 1e-6f))));
  for (const float step : {1.0f, 2.0f, 5.0f})
    if (value <= step * power) return step * power;
  return 10 * power;
}

struct Range {
  float low = 0, high = 1;
};

Range range_of(const History& history, bool is_signed) {
  float low = 0, high = 0;
  for (const float v : history.values) low = std::min(low, v), high = std::max(high, v);
  if (!is_signed) return {0, rounded_up(std::max(high * 1.05f, 1e-3f))};
  const float most = rounded_up(std::max({-low, high, 0.1f}));
  return {low < 0 ? -most : 0, high > 0 ? most : 0};
}

void draw_plot(const char* title, const char* unit, const History& history, bool is_signed, float width) {
  ImGui::BeginGroup();
  ImGui::TextDisabled("%s", title);
  const float current = history.values.empty() ? 0.0f : history.values.back();
  const std::string value = history.values.empty() ? std::string()
                            : is_signed            ? fmt::format("{:+.3f} {}", current, unit)
                                                   : fmt::format("{:.3g} {}", current, unit);
  ImGui::SameLine(width - ImGui::CalcTextSize(value.c_str()).x);
  ImGui::TextUnformatted(value.c_str());
  const Range range = range_of(history, is_signed);
  ImGui::PlotLines(fmt::format("##{}", title).c_str(), history.values.data(), int(history.values.size()), 0,
                   nullptr, range.low, range.high, ImVec2(width, ImGui::GetContentRegionAvail().y));
  // The scale, in the plot's own corners.
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
  const ImU32 grey = ImGui::GetColorU32(ImGuiCol_TextDisabled, 0.85f);
  const float size = ImGui::GetFontSize() * 0.8f, pad = ImGui::GetStyle().FramePadding.x * 0.6f;
  draw->AddText(nullptr, size, ImVec2(low.x + pad, low.y + 1), grey, fmt::format("{:g}", range.high).c_str());
  draw->AddText(nullptr, size, ImVec2(low.x + pad, high.y - size - 1), grey,
                fmt::format("{:g}", range.low).c_str());
  ImGui::EndGroup();
}

void draw_plots(const Session& s, const Rect& place) {
  begin_fixed("plots", place);
  const float gap = 2 * ImGui::GetStyle().ItemSpacing.x;
  const float width = (ImGui::GetContentRegionAvail().x - 2 * gap) / 3;
  const bool cpu = bool(s.loaded.sim.solver.step_on_cpu);
  const ImVec2 start = ImGui::GetCursorPos();
  draw_plot("frames a second", "fps", s.frames_per_second, false, width);
  ImGui::SetCursorPos(ImVec2(start.x + width + gap, start.y));
  draw_plot(cpu ? "CPU time a step" : "GPU time a step", "ms", s.step_ms, false, width);
  ImGui::SetCursorPos(ImVec2(start.x + 2 * (width + gap), start.y));
  draw_plot("volume error", "%", s.volume_error, true, width);
  end_fixed();
}

std::string short_renderer(const std::string& renderer) {
  const std::size_t end = renderer.find_first_of("(/");
  std::string name = renderer.substr(0, end);
  while (!name.empty() && name.back() == ' ') name.pop_back();
  return name;
}

std::string counted(std::size_t count, const char* what) {
  return count < 10000 ? fmt::format("{} {}", count, what)
                       : fmt::format("{:.1f}k {}", double(count) / 1000, what);
}

void draw_status(const Session& s, const Rect& place) {
  const Sim& sim = s.loaded.sim;
  std::size_t constraints = 0;
  for (std::size_t k = 0; k < sim.system.lists.size(); ++k)
    if (sim.system.present[k]) constraints += sim.system.lists[k].count();
  const bool slow = s.playing && !s.clock.fast && s.clock.factor > 0 && s.clock.factor < 0.95;
  // From the first to be left out where the window is narrow (0 is never).
  struct Part {
    int rank;
    std::string text;
  };
  std::vector<Part> parts{
      {2, short_renderer(s.gl.renderer)},
      {0, "mode " + sim.settings.mode},
      {3, counted(sim.model->positions.size(), "vertices")},
      {1, counted(sim.model->rest.tets.size(), "tets")},
      {4, counted(constraints, "constraints")},
      {0, fmt::format("step {}", sim.steps)},
      {0, fmt::format("{:.3f} s", double(sim.steps) * sim.settings.dt)},
      {0, !s.playing ? std::string("paused") : fmt::format("{:.2g}x real time", s.clock.factor)}};
  begin_fixed("status", place);
  const char* separator = "  \xC2\xB7  ";
  const auto width = [&] {
    float sum = 0;
    for (const Part& part : parts) sum += ImGui::CalcTextSize((part.text + separator).c_str()).x;
    return sum;
  };
  for (int rank = 4; rank > 0 && width() > ImGui::GetContentRegionAvail().x; --rank)
    std::erase_if(parts, [&](const Part& part) { return part.rank == rank; });
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i) {
      ImGui::SameLine(0, 0);
      ImGui::TextDisabled("%s", separator);
      ImGui::SameLine(0, 0);
    }
    const bool last = i + 1 == parts.size();
    if (last && slow)
      ImGui::TextColored(ImVec4(0.72f, 0.33f, 0.05f, 1), "%s", parts[i].text.c_str());
    else
      ImGui::TextUnformatted(parts[i].text.c_str());
  }
  end_fixed();
}

void draw_messages(Session& s, Ui& ui, const Rect& view) {
  constexpr double lasting = 4;  // s, of one that is no error
  std::erase_if(s.messages, [&](const Message& m) { return !m.error && s.now - m.since > lasting; });
  const float margin = 14 * ui.scale, width = std::min(view.width - 2 * margin, 560 * ui.scale);
  float top = view.y + margin;
  std::string dismissed;
  for (std::size_t i = 0; i < s.messages.size(); ++i) {
    const Message message = s.messages[i];
    ImGui::SetNextWindowPos(ImVec2(view.x + margin, top));
    ImGui::SetNextWindowSizeConstraints(ImVec2(0, 0), ImVec2(width, view.height));
    ImGui::PushStyleColor(ImGuiCol_WindowBg,
                          message.error ? ImVec4(0.995f, 0.925f, 0.905f, 0.97f) : ImVec4(1, 1, 1, 0.93f));
    ImGui::PushStyleColor(ImGuiCol_Border,
                          message.error ? ImVec4(0.80f, 0.36f, 0.26f, 0.8f) : ImVec4(0.80f, 0.82f, 0.84f, 1));
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
    // By place, not by text: Dear ImGui keeps every window it has ever been told of.
    ImGui::Begin(fmt::format("message {}", i).c_str(), nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoFocusOnAppearing);
    if (message.error) {
      ImGui::PushTextWrapPos(width - ImGui::GetStyle().WindowPadding.x);
      ImGui::TextUnformatted(message.text.c_str());
      ImGui::PopTextWrapPos();
      if (ImGui::SmallButton("Dismiss")) dismissed = message.text;
      mark(s, ui, "dismiss");
      if (message.offer_reset) {
        ImGui::SameLine();
        if (ImGui::SmallButton("Reset")) restart(s);
        mark(s, ui, "reset after error");
        ImGui::SameLine();
        if (ImGui::SmallButton("Back to the last good state")) go_back(s);
        mark(s, ui, "back");
      }
    } else {
      ImGui::TextUnformatted(message.text.c_str());
    }
    top += ImGui::GetWindowHeight() + 6 * ui.scale;
    ImGui::End();
    ImGui::PopStyleVar();
    ImGui::PopStyleColor(2);
  }
  if (!dismissed.empty()) {
    std::erase_if(s.messages, [&](const Message& m) { return m.text == dismissed; });
    s.log("dismissed");
  }
}

using HelpRows = std::vector<std::pair<const char*, const char*>>;

void help_rows(const char* title, const HelpRows& rows) {
  float column = 0;
  for (const auto& row : rows) column = std::max(column, ImGui::CalcTextSize(row.first).x);
  ImGui::TextDisabled("%s", title);
  for (const auto& [keys, help] : rows) {
    ImGui::TextColored(ImVec4(0.18f, 0.42f, 0.60f, 1), "%s", keys);
    ImGui::SameLine(column + 2 * ImGui::GetStyle().ItemSpacing.x);
    ImGui::TextUnformatted(help);
  }
}

void draw_help(Ui& ui, const Layout& layout) {
  const float width = layout.view.width + (ui.panels ? layout.panel.width : 0),
              height = layout.status.y + layout.status.height;
  ImGui::SetNextWindowPos(ImVec2(width / 2, height / 2), ImGuiCond_Always, ImVec2(0.5f, 0.5f));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(24 * ui.scale, 20 * ui.scale));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 10 * ui.scale);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
  ImGui::PushStyleColor(ImGuiCol_WindowBg, ImVec4(0.99f, 0.99f, 0.995f, 1));
  ImGui::SetNextWindowFocus();
  ImGui::Begin("help", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_AlwaysAutoResize);
  HelpRows rows;
  for (const Shortcut& shortcut : shortcuts()) rows.emplace_back(shortcut.shown, shortcut.help);
  ImGui::BeginGroup();
  help_rows("Keys", rows);
  ImGui::EndGroup();
  ImGui::SameLine(0, 36 * ui.scale);
  ImGui::BeginGroup();
  help_rows("Mouse", {{"Left drag", "pull the body, or turn the view beside it"},
                      {"Right drag", "turn the view"},
                      {"Middle drag", "move the view (or Shift + drag)"},
                      {"Wheel", "closer, farther"},
                      {"Double click", "pin a vertex, or free it (or Ctrl + click)"}});
  ImGui::Dummy(ImVec2(0, 10 * ui.scale));
  help_rows("Sliders", {{"Ctrl + click", "type a value"}, {"Hover", "what it means"}});
  ImGui::EndGroup();
  ImGui::End();
  ImGui::PopStyleColor();
  ImGui::PopStyleVar(3);
}

}  // namespace

void draw_edge(const Rect& place, float to_x, float to_y) {
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->PushClipRectFullScreen();
  draw->AddLine(ImVec2(place.x, place.y), ImVec2(to_x, to_y), ImGui::GetColorU32(ImGuiCol_Border));
  draw->PopClipRect();
}

const std::vector<Shortcut>& shortcuts() {
  static const std::vector<Shortcut> rows = {
      {GLFW_KEY_SPACE, 0, 0, "Space", "play, pause", [](Session& s, Ui&) { play(s, !s.playing); }},
      {GLFW_KEY_S, GLFW_KEY_RIGHT, 0, "S, Right", "one step", [](Session& s, Ui&) { single_step(s); }},
      {GLFW_KEY_R, 0, 0, "R", "reset", [](Session& s, Ui&) { restart(s); }},
      {GLFW_KEY_F, 0, 0, "F", "show all of the body", [](Session& s, Ui&) { frame_body(s); }},
      {GLFW_KEY_1, GLFW_KEY_KP_1, 0, "1", "surface", [](Session& s, Ui&) { set_look(s, Look::surface); }},
      {GLFW_KEY_2, GLFW_KEY_KP_2, 0, "2", "surface with edges",
       [](Session& s, Ui&) { set_look(s, Look::wire); }},
      {GLFW_KEY_3, GLFW_KEY_KP_3, 0, "3", "tetrahedra", [](Session& s, Ui&) { set_look(s, Look::tets); }},
      {GLFW_KEY_C, 0, 0, "C", "next colour",
       [](Session& s, Ui&) {
         s.view.colour = Colour((std::size_t(s.view.colour) + 1) % colour_names.size());
         s.log("colour {}", colour_names[std::size_t(s.view.colour)]);
       }},
      {GLFW_KEY_N, 0, 0, "N", "smooth or flat normals",
       [](Session& s, Ui&) {
         s.view.smooth_normals = !s.view.smooth_normals;
         s.log("normals {}", s.view.smooth_normals ? "smooth" : "flat");
       }},
      {GLFW_KEY_G, 0, 0, "G", "grid",
       [](Session& s, Ui&) {
         s.view.grid = !s.view.grid;
         s.log("grid {}", s.view.grid);
       }},
      {GLFW_KEY_M, 0, 0, "M", "plots", [](Session&, Ui& ui) { ui.plots = !ui.plots; }},
      {GLFW_KEY_TAB, 0, 0, "Tab", "panels",
       [](Session& s, Ui& ui) {
         ui.panels = !ui.panels;
         s.log("panels {}", ui.panels);
       }},
      {GLFW_KEY_P, 0, 0, "P", "screenshot without panels", [](Session& s, Ui&) { s.take_screenshot = true; }},
      {GLFW_KEY_H, GLFW_KEY_F1, 0, "H, F1", "this help",
       [](Session& s, Ui& ui) {
         ui.help = !ui.help;
         s.log("help {}", ui.help);
       }},
      {GLFW_KEY_ESCAPE, 0, 0, "Esc", "close help, messages; let go",
       [](Session& s, Ui& ui) {
         if (ui.help)
           s.log("help false");
         else if (s.grab)
           let_go(s);
         else
           s.messages.clear();
         ui.help = false;
       }},
      {GLFW_KEY_Q, 0, GLFW_MOD_CONTROL, "Ctrl + Q", "quit", [](Session& s, Ui&) { s.quit = true; }},
  };
  return rows;
}

Layout make_layout(const Ui& ui, float width, float height) {
  Layout layout;
  const float status = std::round(28 * ui.scale);
  const float panel = ui.panels ? std::min(std::round(320 * ui.scale), width * 0.6f) : 0;
  const float plots = ui.panels && ui.plots && height > 360 * ui.scale ? std::round(104 * ui.scale) : 0;
  const float bottom = ui.panels ? std::max(height - status, 1.0f) : height;
  layout.view = {0, 0, std::max(width - panel, 1.0f), std::max(bottom - plots, 1.0f)};
  layout.panel = {width - panel, 0, panel, bottom};
  layout.plots = {0, layout.view.height, layout.view.width, plots};
  layout.status = {0, bottom, width, height - bottom};
  return layout;
}

void draw_ui(Session& s, Ui& ui, const Layout& layout) {
  mark(s, ui, "view", layout.view);
  if (ui.panels) {
    draw_panel(s, ui, layout.panel);
    if (layout.plots.height > 0) draw_plots(s, layout.plots);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(14 * ui.scale, 5 * ui.scale));
    ImGui::PushStyleColor(ImGuiCol_WindowBg, ImVec4(0.925f, 0.932f, 0.940f, 1));
    draw_status(s, layout.status);
    ImGui::PopStyleColor();
    ImGui::PopStyleVar();
  }
  draw_messages(s, ui, layout.view);
  if (ui.help) draw_help(ui, layout);
}

void draw_busy(const Layout& layout, const std::string& what) {
  const Rect& view = layout.view;
  ImGui::SetNextWindowPos(ImVec2(view.x + view.width / 2, view.y + view.height / 2), ImGuiCond_Always,
                          ImVec2(0.5f, 0.5f));
  ImGui::Begin("busy", nullptr, fixed_window | ImGuiWindowFlags_AlwaysAutoResize);
  ImGui::Text("%s ...", what.c_str());
  ImGui::End();
}

}  // namespace tetpbd
