// Around the panel: plots, status line, messages, help, and how the window is shared out.
#include "app/ui.h"

#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>

#include "app/run_loop.h"
#include "render/legend.h"

namespace tetpbd {

namespace {

void set_look(Session& s, Look look) {
  s.view.look = look;
  s.log("look {}", look_names[std::size_t(look)]);
}

void next_colour(Session& s) {
  auto next = std::size_t(s.view.colour);
  do next = (next + 1) % colour_names.size();
  while (!has_colour(s, Colour(next)));
  choose_colour(s, Colour(next));
}

void flip(Session& s, const char* name, bool& value) { s.log("{} {}", name, value = !value); }

void escape(Session& s) {
  if (s.ui.help)
    flip(s, "help", s.ui.help);
  else if (s.grab)
    let_go(s);
  else
    s.messages.clear();
}

constexpr ImGuiWindowFlags plain_window =
    ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
    ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing;

// What is cut off first in a narrow window stands last.
void draw_status(const Session& s, const Rect& place) {
  const Sim& sim = s.loaded.sim();
  begin_part("status", place);
  const bool slow =
      s.playing && !s.clock.fast && s.clock.factor > 0 && s.clock.factor < 0.95 * s.clock.speed();
  const std::string speed = s.timeline.looping ? "looping"
                            : s.playing        ? fmt::format("{:.2g}x real time", s.clock.factor)
                                               : "paused";
  ImGui::TextColored(slow ? ImVec4(0.72f, 0.33f, 0.05f, 1) : ImGui::GetStyleColorVec4(ImGuiCol_Text), "%s",
                     speed.c_str());
  ImGui::SameLine();
  const char* dot = "\xC2\xB7";
  const std::string rest = fmt::format(
      "{0}  step {1}  {0}  {2:.3f} s  {0}  mode {3}  {0}  {4} tets  {0}  {5} vertices  {0}  {6} constraints  "
      "{0}  {7}",
      dot, sim.steps, double(sim.steps) * sim.settings.dt, sim.settings.mode, sim.model->rest.tets.size(),
      sim.model->positions.size(), sim.system.count(), s.gl.renderer);
  ImGui::TextUnformatted(rest.c_str());
  ImGui::End();
}

void draw_messages(Session& s, const Rect& view) {
  constexpr double lasting = 4;  // s, of one that is no error
  std::erase_if(s.messages, [&](const Message& m) { return !m.error && s.now - m.since > lasting; });
  const float margin = 14 * s.ui.scale, width = std::min(view.width - 2 * margin, 560 * s.ui.scale);
  float top = view.y + margin;
  std::function<void()> pressed;  // changes the messages, so after the loop
  const auto offer = [&](const char* label, const char* name, auto act) {
    if (ImGui::SmallButton(label)) pressed = act;
    mark(s, name);
  };
  for (std::size_t i = 0; i < s.messages.size(); ++i) {
    const Message& message = s.messages[i];
    ImGui::SetNextWindowPos(ImVec2(view.x + margin, top));
    ImGui::SetNextWindowSizeConstraints(ImVec2(0, 0), ImVec2(width, view.height));
    ImGui::PushStyleColor(ImGuiCol_Text, message.error ? ImVec4(0.65f, 0.1f, 0.05f, 1)
                                                       : ImGui::GetStyleColorVec4(ImGuiCol_Text));
    // By place, not by text: Dear ImGui keeps every window it has ever been told of.
    ImGui::Begin(fmt::format("message {}", i).c_str(), nullptr,
                 plain_window | ImGuiWindowFlags_AlwaysAutoResize);
    ImGui::PushTextWrapPos(width - ImGui::GetStyle().WindowPadding.x);
    ImGui::TextUnformatted(message.text.c_str());
    ImGui::PopTextWrapPos();
    ImGui::PopStyleColor();
    if (message.non_finite) {
      offer("Reset", "reset after error", [&s] { restart(s); });
      ImGui::SameLine();
      offer("Back to the last good state", "back", [&s] { go_back(s); });
    } else if (message.error) {
      offer("Dismiss", "dismiss", [&s, i] {
        s.messages.erase(s.messages.begin() + std::ptrdiff_t(i));
        s.log("dismissed");
      });
    }
    top += ImGui::GetWindowHeight() + 6 * s.ui.scale;
    ImGui::End();
  }
  if (pressed) pressed();
}

// What the cursor points at, beside it.
void draw_reading(const Session& s, const Reading& r) {
  const Lane& lane = s.loaded.lanes[s.loaded.probe.lane];
  ImGui::BeginTooltip();
  const bool held = !(lane.sim.inverse_masses[r.vertex] > 0);
  ImGui::Text("vertex %u%s, tet %u", lane.sim.model->original[r.vertex], held ? " (held)" : "", r.tet);
  if (ImGui::BeginTable("reading", 2, ImGuiTableFlags_SizingFixedFit)) {
    const auto row = [](const char* name, const std::string& value) {
      ImGui::TableNextColumn();
      ImGui::TextDisabled("%s", name);
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(value.c_str());
    };
    row("position", fmt::format("{:.4f}, {:.4f}, {:.4f} m", r.position.x, r.position.y, r.position.z));
    row("speed", fmt::format("{:.4g} m/s", r.speed));
    row("volume", fmt::format("{:.4f} of rest", 1 + r.volume));
    row("edge strain", fmt::format("{:+.3g} %", 100 * r.strain));
    if (r.energy) row("elastic energy", fmt::format("{:.4g} J/m\u00b3", *r.energy));
    if (r.distance)
      row(right_now(s) ? "from the right motion" : "from the finest lane",
          fmt::format("{:.3g} % of size", 100 * *r.distance));
    ImGui::EndTable();
  }
  ImGui::EndTooltip();
}

void draw_help(const Ui& ui) {
  const ImVec2 whole = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos(ImVec2(whole.x / 2, whole.y / 2), ImGuiCond_Always, ImVec2(0.5f, 0.5f));
  ImGui::SetNextWindowSize(ImVec2(std::min(760 * ui.scale, whole.x), 0));
  ImGui::SetNextWindowFocus();
  ImGui::Begin("help", nullptr, plain_window);
  constexpr std::pair<const char*, const char*> mouse[] = {
      {"Left drag", "pull the body, or turn the view beside it"},
      {"Right drag", "turn the view"},
      {"Middle drag", "move the view (or Shift + drag)"},
      {"Wheel", "closer, farther"},
      {"Alt + drag, Alt + wheel", "moves the plane of a cut"},
      {"Double click", "pin a vertex, or free it (or Ctrl + click)"},
      {"Ctrl + click on a slider", "type a value"},
      {"Wheel, drag, double click on a plot", "closer, along, all"},
      {"Hover", "what a setting means, what is there"}};
  if (ImGui::BeginTable("help", 2)) {
    ImGui::TableNextColumn();
    ImGui::TextDisabled("Keys");
    for (const Shortcut& shortcut : shortcuts())
      if (*shortcut.shown) ImGui::BulletText("%s: %s", shortcut.shown, shortcut.help);
    ImGui::TableNextColumn();
    ImGui::TextDisabled("Mouse");
    for (const auto& [action, help] : mouse) ImGui::BulletText("%s: %s", action, help);
    ImGui::EndTable();
  }
  ImGui::End();
}

}  // namespace

void begin_part(const char* name, const Rect& place) {
  ImGui::SetNextWindowPos(ImVec2(place.x, place.y));
  ImGui::SetNextWindowSize(ImVec2(place.width, place.height));
  ImGui::Begin(name, nullptr, plain_window | ImGuiWindowFlags_NoBringToFrontOnFocus);
}

void set_style(float scale, float density) {
  ImGui::GetIO().IniFilename = nullptr;  // no file is left behind
  ImGuiStyle& style = ImGui::GetStyle() = ImGuiStyle();
  ImGui::StyleColorsLight(&style);
  style.FrameRounding = style.GrabRounding = 3;
  style.ScaleAllSizes(scale);
  set_font(*ImGui::GetIO().Fonts, std::floor(14.0f * scale * density));
  ImGui::GetIO().FontGlobalScale = 1.0f / density;
}

const std::vector<Shortcut>& shortcuts() {
  static const std::vector<Shortcut> rows = {
      {GLFW_KEY_SPACE, "Space", "play, pause", [](Session& s) { play(s, !s.playing); }},
      {GLFW_KEY_S, "S", "one step", [](Session& s) { single_step(s); }},
      {GLFW_KEY_LEFT, "Left, Right", "back, forward in time", go_backward},
      {GLFW_KEY_RIGHT, "", "", go_forward},
      {GLFW_KEY_COMMA, ", .", "slower, faster", [](Session& s) { change_speed(s, s.clock.halvings + 1); }},
      {GLFW_KEY_PERIOD, "", "", [](Session& s) { change_speed(s, s.clock.halvings - 1); }},
      {GLFW_KEY_R, "R", "reset", [](Session& s) { restart(s); }},
      {GLFW_KEY_F, "F", "show all of the body", [](Session& s) { frame_body(s); }},
      {GLFW_KEY_1, "1", "surface", [](Session& s) { set_look(s, Look::surface); }, GLFW_KEY_KP_1},
      {GLFW_KEY_2, "2", "with edges", [](Session& s) { set_look(s, Look::wire); }, GLFW_KEY_KP_2},
      {GLFW_KEY_3, "3", "tetrahedra", [](Session& s) { set_look(s, Look::tets); }, GLFW_KEY_KP_3},
      {GLFW_KEY_4, "4", "constraint graph", [](Session& s) { set_look(s, Look::graph); }, GLFW_KEY_KP_4},
      {GLFW_KEY_C, "C", "next colour", [](Session& s) { next_colour(s); }},
      {GLFW_KEY_W, "W", "mark the worst vertices", [](Session& s) { flip(s, "worst", s.view.worst); }},
      {GLFW_KEY_X, "X", "cut: none, along x, y, z, the view", [](Session& s) { next_cut(s); }},
      {GLFW_KEY_N, "N", "flat normals", [](Session& s) { flip(s, "normals", s.view.smooth_normals); }},
      {GLFW_KEY_G, "G", "grid", [](Session& s) { flip(s, "grid", s.view.grid); }},
      {GLFW_KEY_L, "L", "follow the bodies", [](Session& s) { flip(s, "follow", s.view.follow); }},
      {GLFW_KEY_M, "M", "plots", [](Session& s) { flip(s, "plots", s.ui.plots); }},
      {GLFW_KEY_TAB, "Tab", "panels", [](Session& s) { flip(s, "panels", s.ui.panels); }},
      {GLFW_KEY_P, "P", "screenshot without panels", [](Session& s) { s.take_screenshot = true; }},
      {GLFW_KEY_H, "H, F1", "this help", [](Session& s) { flip(s, "help", s.ui.help); }, GLFW_KEY_F1},
      {GLFW_KEY_K, "K", "a lane more", [](Session& s) { add_lane(s); }},
      {GLFW_KEY_J, "J", "a lane less", [](Session& s) { remove_lane(s); }},
      {GLFW_KEY_O, "O", "lanes overlaid", [](Session& s) { flip(s, "overlaid", s.overlaid); }},
      {GLFW_KEY_ESCAPE, "Esc", "close help; let go; close messages", escape},
      {GLFW_KEY_Q, "Ctrl + Q", "quit", [](Session& s) { s.quit = true; }, 0, GLFW_MOD_CONTROL},
  };
  return rows;
}

Layout make_layout(const Ui& ui, float width, float height) {
  Layout layout;
  const float status = std::round(32 * ui.scale);
  const float panel = ui.panels ? std::min(std::round(320 * ui.scale), width * 0.6f) : 0;
  const float plots = ui.panels && ui.plots && height > 360 * ui.scale ? std::round(128 * ui.scale) : 0;
  const float timeline = ui.panels && height > 240 * ui.scale ? std::round(38 * ui.scale) : 0;
  const float bottom = ui.panels ? std::max(height - status, 1.0f) : height;
  layout.view = {0, 0, std::max(width - panel, 1.0f), std::max(bottom - plots - timeline, 1.0f)};
  layout.panel = {width - panel, 0, panel, bottom};
  layout.timeline = {0, layout.view.height, layout.view.width, timeline};
  layout.plots = {0, layout.view.height + timeline, layout.view.width, plots};
  layout.status = {0, bottom, width, height - bottom};
  return layout;
}

void draw_ui(Session& s, const Layout& layout) {
  mark(s, "view", layout.view);
  for (std::size_t i = 0; i < s.loaded.lanes.size() && s.loaded.lanes.size() > 1 && !s.overlaid; ++i) {
    const Rect place = lane_place(s, i, layout.view);
    const glm::vec3 colour = lane_colour(i);
    const bool chosen = i == s.loaded.chosen;
    ImGui::GetBackgroundDrawList()->AddRect(
        ImVec2(place.x + 1, place.y + 1), ImVec2(place.x + place.width - 1, place.y + place.height - 1),
        ImGui::GetColorU32(ImVec4(colour.x, colour.y, colour.z, chosen ? 1.0f : 0.5f)), 0, 0,
        (chosen ? 3.0f : 1.0f) * s.ui.scale);
  }
  if (s.ui.panels) {
    begin_part("panel", layout.panel);
    draw_panel(s);
    ImGui::End();
    if (layout.timeline.height > 0) {
      begin_part("timeline", layout.timeline);
      draw_timeline(s);
      ImGui::End();
    }
    if (layout.plots.height > 0) draw_plots(s, layout.plots);
    draw_status(s, layout.status);
  }
  draw_messages(s, layout.view);
  if (s.loaded.probe.reading) draw_reading(s, *s.loaded.probe.reading);
  if (s.ui.help) draw_help(s.ui);
}

void draw_busy(const Layout& layout, const std::string& what) {
  const Rect& view = layout.view;
  ImGui::SetNextWindowPos(ImVec2(view.x + view.width / 2, view.y + view.height / 2), ImGuiCond_Always,
                          ImVec2(0.5f, 0.5f));
  ImGui::Begin("busy", nullptr, plain_window | ImGuiWindowFlags_AlwaysAutoResize);
  ImGui::Text("%s ...", what.c_str());
  ImGui::End();
}

}  // namespace tetpbd
