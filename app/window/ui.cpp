// Around the panel: plots, status line, messages, help, and how the window is shared out.
#include "app/window/ui.h"

#include <GLFW/glfw3.h>
#include <imgui_internal.h>

#include <algorithm>
#include <cmath>

#include "app/lab/run.h"
#include "app/window/edit_obstacles.h"
#include "app/window/widgets.h"
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
  if (ImGui::GetCurrentContext()->OpenPopupStack.Size > 0)
    ImGui::ClosePopupToLevel(0, true), s.log("list closed");
  else if (s.ui.help)
    flip(s, "help", s.ui.help);
  else if (s.grab)
    let_go(s);
  else if (s.obstacle >= 0)
    choose_obstacle(s, -1);
  else
    s.messages.clear();
}

constexpr ImGuiWindowFlags plain_window = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                                          ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoCollapse |
                                          ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing;

// What is cut off first in a narrow window stands last, but for the way to the help.
void draw_status(Session& s, const Rect& place) {
  const Sim& sim = s.loaded.sim();
  begin_part("status", place);
  const std::string speed = s.timeline.looping ? "looping"
                            : s.playing        ? fmt::format("{:.2g}x real time", s.clock.factor)
                                               : "paused";
  const char* dot = "\xC2\xB7";
  const bool slow = s.playing && !s.clock.fast && s.clock.factor > 0 && s.clock.factor < 0.95 * s.clock.speed();
  const char* film = s.filming ? "V: end the video" : "V: video";
  const bool wide = place.width > 50 * ImGui::GetFontSize();
  const std::string buttons = fmt::format("{}H: help", wide ? fmt::format("P: picture  {}  ", film) : "");
  const float right = ImGui::CalcTextSize(buttons.c_str()).x + 4 * ImGui::GetStyle().WindowPadding.x;
  ImGui::PushClipRect(ImVec2(place.x, place.y), ImVec2(place.x + place.width - right, place.y + place.height), true);
  ImGui::TextColored(slow ? alarm(s) : ImGui::GetStyleColorVec4(ImGuiCol_Text), "%s", speed.c_str());
  if (const auto faster = faster_way(s)) {
    ImGui::SameLine();
    ImGui::TextColored(alarm(s), "%sfaster:", s.gl.software ? "(software renderer) " : "");
    ImGui::SameLine();
    if (faster->words.empty() && !faster->act) {
      ImGui::TextColored(alarm(s), "%s", faster->said.c_str());
    } else {
      const bool pressed = ImGui::SmallButton(faster->said.c_str());
      if (pressed && faster->act)
        faster->act(s);
      else if (pressed)
        attempt(s, [&] { change_settings(s, lane_settings(sim.settings, faster->words, faster->said)); });
      mark(s, "faster");
    }
  }
  ImGui::SameLine();
  const std::string rest = fmt::format(
      "{0}  step {1}  {0}  {2:.3f} s  {0}  mode {3}  {0}  {4} tets  {0}  {5} vertices  {0}  {6} constraints  "
      "{0}  {7}",
      dot, s.loaded.lane().steps(), s.loaded.lane().time(), sim.settings.mode, sim.model->rest.tets.size(),
      sim.model->positions.size(), sim.system.count(), s.gl.renderer);
  ImGui::TextUnformatted(rest.c_str());
  ImGui::PopClipRect();
  ImGui::SameLine(place.width - right);
  if (wide) {
    if (ImGui::SmallButton("P: picture")) s.take_screenshot = true;
    describe_item(s, "picture", "the view without panels, into the current folder");
    ImGui::SameLine();
    if (s.filming) ImGui::PushStyleColor(ImGuiCol_Text, alarm(s));
    const bool pressed = ImGui::SmallButton(film);
    if (s.filming) ImGui::PopStyleColor();
    describe_item(s, "film", "the view without panels, as it is seen, into the current folder");
    if (pressed) s.filming = !s.filming;
    ImGui::SameLine();
  }
  if (ImGui::SmallButton("H: help")) flip(s, "help", s.ui.help);
  describe_item(s, "help", "all keys, and what the mouse does, in place of the panel");
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
    ImGui::PushStyleColor(ImGuiCol_Text, message.error ? alarm(s) : ImGui::GetStyleColorVec4(ImGuiCol_Text));
    // By place, not by text: Dear ImGui keeps every window it has ever been told of.
    ImGui::Begin(fmt::format("message {}", i).c_str(), nullptr, plain_window | ImGuiWindowFlags_AlwaysAutoResize);
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
      row(right_now(s) ? "from the reference motion" : "from the finest lane",
          fmt::format("{:.3g} % of size", 100 * *r.distance));
    ImGui::EndTable();
  }
  ImGui::EndTooltip();
}

// In place of the panel, so that the bodies stay in sight, and the mouse can be tried.
void draw_help(Session& s) {
  constexpr std::pair<const char*, const char*> mouse[] = {
      {"Left drag", "pull the body, or turn the view beside it"},
      {"Right drag", "turn the view"},
      {"Middle drag", "move the view (or Shift + drag)"},
      {"Wheel", "closer, farther"},
      {"Double click", "pin a vertex, or free it (or Ctrl + click)"},
      {"Alt + drag", "move the plane of a cut (or Alt + wheel)"},
      {"Obstacle", "click: choose it, then drag: move, Ctrl + drag: turn"},
      {"Rest", "what a setting means, what is there on a body"},
      {"Right click", "on a setting: back to the scene's"},
      {"Ctrl + click", "on a slider: type a value"},
      {"Plots", "wheel: closer, drag: along, double click: all"},
      {"Drop a file", "a scene or a mesh, to open it"}};
  if (button(s, "Back to the settings", "close help", "H or Esc", -1)) flip(s, "help", s.ui.help);
  const auto list = [&](const char* title, auto rows) {
    ImGui::Spacing();
    ImGui::TextColored(accent(s), "%s", title);
    if (!ImGui::BeginTable(title, 2)) return;
    ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthFixed, 6.6f * ImGui::GetFontSize());
    rows([](const char* shown, const char* help) {
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(shown);
      ImGui::TableNextColumn();
      ImGui::TextWrapped("%s", help);
    });
    ImGui::EndTable();
  };
  list("Mouse", [&](auto row) {
    for (const auto& [action, help] : mouse) row(action, help);
  });
  list("Keys", [&](auto row) {
    for (const Shortcut& shortcut : shortcuts())
      if (*shortcut.shown) row(shortcut.shown, shortcut.help);
  });
}

// Between view and panel, or view and plots: dragged, it makes the one wider or the others higher.
void draw_edge(Session& s, const char* name, const Rect& place, bool upright, auto drag) {
  const float wide = 6 * s.ui.scale;
  const Rect edge = upright ? Rect{place.x - wide / 2, place.y, wide, place.height}
                            : Rect{place.x, place.y - wide / 2, place.width, wide};
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(0, 0));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, ImVec2(1, 1));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0);
  ImGui::SetNextWindowBgAlpha(0);
  begin_part(name, edge);
  ImGui::InvisibleButton(name, ImVec2(edge.width, edge.height));
  mark(s, name);
  if (ImGui::IsItemHovered() || ImGui::IsItemActive())
    ImGui::SetMouseCursor(upright ? ImGuiMouseCursor_ResizeEW : ImGuiMouseCursor_ResizeNS);
  if (ImGui::IsItemActive()) drag();
  ImGui::End();
  ImGui::PopStyleVar(3);
}

ImVec2 seen(const Session& s, const Rect& place, const glm::dvec3& point) {
  const glm::vec2 at = seen_at(s, place, point);
  return {at.x, at.y};
}

// What a first look shows one can do, until it was done, in the first runs.
void draw_hints(Session& s, const Rect& view) {
  constexpr double fading = 4;  // s
  const double left = s.hints_until - s.now;
  if (left <= 0) return;
  static constexpr const char* texts[] = {"drag the body", "double click: pin a vertex", "K: compare solvers"};
  std::string line;
  for (std::size_t k = 0; k < std::size(texts); ++k)
    if (!s.ui.hinted[k]) line += (line.empty() ? "" : "  \xC2\xB7  ") + std::string(texts[k]);
  const ImVec2 size = ImGui::CalcTextSize(line.c_str());
  const ImVec2 at(view.x + (view.width - size.x) / 2, view.y + view.height - 2.5f * size.y);
  const auto alpha = [&](float most) { return most * float(std::min(1.0, left / fading)); };
  const float margin = 8 * s.ui.scale;
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  if (line.empty()) return;
  draw.AddRectFilled(ImVec2(at.x - margin, at.y - margin / 2),
                     ImVec2(at.x + size.x + margin, at.y + size.y + margin / 2),
                     ImGui::GetColorU32(ImVec4(0.1f, 0.1f, 0.1f, alpha(0.6f))), margin / 2);
  draw.AddText(at, ImGui::GetColorU32(ImVec4(1, 1, 1, alpha(1))), line.c_str());
}

// From what is held to the cursor: how far it lags says how hard it is pulled.
void draw_pull(const Session& s, const Rect& view) {
  const Rect place = lane_place(s, s.loaded.chosen, view);
  const ImVec2 from = seen(s, place, s.grab->position), to = ImGui::GetIO().MousePos;
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  draw.PushClipRect(ImVec2(place.x, place.y), ImVec2(place.x + place.width, place.y + place.height));
  for (const auto& [colour, width] :
       {std::pair(IM_COL32(255, 255, 255, 200), 5.0f), {IM_COL32(200, 70, 0, 255), 2.5f}}) {
    draw.AddLine(from, to, colour, width * s.ui.scale);
    draw.AddCircle(from, 9 * s.ui.scale, colour, 0, width * s.ui.scale);
  }
  draw.PopClipRect();
}

// The outline of the chosen obstacle, and arrows along which it can be dragged.
void draw_gizmo(Session& s, const Rect& view) {
  const Rect place = lane_place(s, s.loaded.chosen, view);
  const Obstacle& o = asked_obstacles(s)[std::size_t(s.obstacle)];
  const Pose pose = pose_at(o, s.loaded.lane().time());
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  draw.PushClipRect(ImVec2(place.x, place.y), ImVec2(place.x + place.width, place.y + place.height));
  const auto line = [&](const glm::dvec3& a, const glm::dvec3& b, ImU32 colour, float width) {
    if (in_front(s, a) && in_front(s, b))
      draw.AddLine(seen(s, place, a), seen(s, place, b), colour, width * s.ui.scale);
  };
  if (o.kind->half) {
    const glm::dvec3 half = o.kind->half(o);
    const auto corner = [&](int bits) {
      const glm::dvec3 side(bits & 1 ? 1 : -1, bits & 2 ? 1 : -1, bits & 4 ? 1 : -1);
      return pose.centre + pose.axes * (side * half);
    };
    for (int bits = 0; bits < 8; ++bits)
      for (const int axis : {1, 2, 4})
        if (!(bits & axis)) line(corner(bits), corner(bits | axis), ImGui::GetColorU32(accent(s)), 1.5f);
  }
  const double length = gizmo_length(s);
  constexpr ImU32 colours[] = {IM_COL32(214, 58, 48, 255), IM_COL32(72, 150, 48, 255), IM_COL32(48, 96, 214, 255)};
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 tip = pose.centre;
    tip[axis] += length;
    line(pose.centre, tip, colours[axis], 3);
    if (!in_front(s, tip)) continue;
    draw.AddCircleFilled(seen(s, place, tip), 5.5f * s.ui.scale, colours[axis]);
    const ImVec2 at = seen(s, place, tip);
    mark(s, fmt::format("gizmo {}", "xyz"[axis]), {at.x - 1, at.y - 1, 2, 2});
  }
  draw.PopClipRect();
  const ImVec2 at = seen(s, place, pose.centre);
  mark(s, "chosen obstacle", {at.x - 1, at.y - 1, 2, 2});
}

}  // namespace

void begin_part(const char* name, const Rect& place) {
  ImGui::SetNextWindowPos(ImVec2(place.x, place.y));
  ImGui::SetNextWindowSize(ImVec2(place.width, place.height));
  ImGui::Begin(name, nullptr, plain_window | ImGuiWindowFlags_NoBringToFrontOnFocus);
}

void set_style(float scale, float density, bool dark) {
  ImGui::GetIO().IniFilename = nullptr;  // no file is left behind
  ImGuiStyle& style = ImGui::GetStyle() = ImGuiStyle();
  dark ? ImGui::StyleColorsDark(&style) : ImGui::StyleColorsLight(&style);
  style.Colors[ImGuiCol_WindowBg].w = style.Colors[ImGuiCol_PopupBg].w = 1;
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
      {GLFW_KEY_F, "F", "show all bodies and obstacles", [](Session& s) { frame_body(s); }},
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
      {GLFW_KEY_B, "B", "the panel is of the body under the mouse", choose_body_at_cursor},
      {GLFW_KEY_U, "U", "hide the body under the mouse; beside all: show all", hide_or_show},
      {GLFW_KEY_V, "V", "video without panels: begin, end", [](Session& s) { s.filming = !s.filming; }},
      {GLFW_KEY_P, "P", "screenshot without panels", [](Session& s) { s.take_screenshot = true; }},
      {GLFW_KEY_H, "H, F1", "this help", [](Session& s) { flip(s, "help", s.ui.help); }, GLFW_KEY_F1},
      {GLFW_KEY_K, "K", "a lane more", [](Session& s) { add_lane(s); }},
      {GLFW_KEY_J, "J", "a lane less", [](Session& s) { remove_lane(s, s.loaded.lanes.size() - 1); }},
      {GLFW_KEY_O, "O", "lanes overlaid", [](Session& s) { flip(s, "overlaid", s.overlaid); }},
      {GLFW_KEY_Z, "Ctrl + Z", "undo a change of settings, lanes, obstacles, pins", undo, 0, GLFW_MOD_CONTROL},
      {GLFW_KEY_Y, "Ctrl + Y", "redo (or Ctrl + Shift + Z)", redo, 0, GLFW_MOD_CONTROL},
      {GLFW_KEY_Z, "", "", redo, 0, GLFW_MOD_CONTROL | GLFW_MOD_SHIFT},
      {GLFW_KEY_S, "Ctrl + S", "save the scene with its settings", save_scene, 0, GLFW_MOD_CONTROL},
      {GLFW_KEY_DELETE, "Delete", "remove the chosen obstacle", remove_obstacle},
      {GLFW_KEY_ESCAPE, "Esc", "close a list or the help; let go; close messages", escape},
      {GLFW_KEY_Q, "Ctrl + Q", "quit", [](Session& s) { s.quit = true; }, 0, GLFW_MOD_CONTROL},
  };
  return rows;
}

Layout make_layout(const Ui& ui, float width, float height) {
  Layout layout;
  const float status = std::round(32 * ui.scale);
  const bool shown = ui.panels || ui.help;
  const float panel = shown ? std::min(std::round(float(ui.kept.panel) * ui.scale), width * 0.6f) : 0;
  const bool plotted = ui.panels && ui.plots && height > 360 * ui.scale;
  const float plots = plotted ? std::min(std::round(float(ui.kept.plots) * ui.scale), height * 0.5f) : 0;
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
  if (s.grab) draw_pull(s, layout.view);
  draw_hints(s, layout.view);
  if (s.obstacle >= 0) draw_gizmo(s, layout.view);
  if (layout.panel.width > 0) {
    draw_edge(s, "edge", layout.panel, true, [&] {  // such windows stand before those that come after them
      const double right = double(layout.panel.x + layout.panel.width);
      s.ui.kept.panel =
          std::clamp((right - double(ImGui::GetIO().MousePos.x)) / double(s.ui.scale), least_panel, most_panel);
    });
    begin_part(s.ui.help ? "help" : "panel", layout.panel);
    s.ui.help ? draw_help(s) : draw_panel(s);
    ImGui::End();
  }
  if (s.ui.panels) {
    if (layout.timeline.height > 0) {
      begin_part("timeline", layout.timeline);
      draw_timeline(s);
      ImGui::End();
    }
    if (layout.plots.height > 0) {
      draw_edge(s, "edge of plots", layout.plots, false, [&] {
        const double below = double(layout.plots.y + layout.plots.height);
        s.ui.kept.plots =
            std::clamp((below - double(ImGui::GetIO().MousePos.y)) / double(s.ui.scale), least_plots, most_plots);
      });
      draw_plots(s, layout.plots);
    }
    draw_status(s, layout.status);
  }
  draw_messages(s, layout.view);
  if (s.loaded.probe.reading) draw_reading(s, *s.loaded.probe.reading);
  s.changes.open = s.changes.open && (ImGui::IsAnyItemActive() || s.moving_obstacle);
}

bool draw_busy(Session& s, const Layout& layout, const std::string& what, std::optional<double> part) {
  const Rect& view = layout.view;
  ImGui::SetNextWindowPos(ImVec2(view.x + view.width / 2, view.y + view.height / 2), ImGuiCond_Always,
                          ImVec2(0.5f, 0.5f));
  ImGui::Begin(part ? "progress" : "busy", nullptr, plain_window | ImGuiWindowFlags_AlwaysAutoResize);
  ImGui::Text("%s ...", what.c_str());
  bool cancelled = false;
  if (part) {
    ImGui::ProgressBar(float(*part), ImVec2(18 * ImGui::GetFontSize(), 0));
    cancelled = button(s, "Cancel", "cancel", "Esc", -1);
  }
  ImGui::End();
  return cancelled;
}

}  // namespace tetpbd
