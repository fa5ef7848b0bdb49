#include "app/input.h"

#include <GLFW/glfw3.h>

#include <cmath>

namespace tetpbd {

namespace {

constexpr double double_click = 0.35;  // s, the usual setting of desktops
constexpr double same_place = 6;       // window coordinates between the clicks of a double click

Ray ray_at(const Session& s, const Rect& view, double x, double y) {
  // Only ratios count, so window coordinates do as well as pixels.
  return pixel_ray(s.camera, float(x) - view.x, float(y) - view.y, int(view.width), int(view.height));
}

void press(Session& s, Mouse& mouse, const Event& event, const Rect& view) {
  if (mouse.drag != Mouse::Drag::none || !view.contains(event.x, event.y) || ImGui::GetIO().WantCaptureMouse)
    return;
  const bool left = event.code == GLFW_MOUSE_BUTTON_LEFT;
  const bool twice = left && s.now - mouse.last_press < double_click &&
                     std::abs(event.x - mouse.press_x) < same_place &&
                     std::abs(event.y - mouse.press_y) < same_place;
  mouse.button = event.code;
  if (event.code == GLFW_MOUSE_BUTTON_MIDDLE || (left && (event.modifiers & GLFW_MOD_SHIFT)))
    mouse.drag = Mouse::Drag::pan;
  else if (event.code == GLFW_MOUSE_BUTTON_RIGHT)
    mouse.drag = Mouse::Drag::orbit;
  else if (left) {
    mouse.pinning = twice || (event.modifiers & GLFW_MOD_CONTROL);
    mouse.drag = Mouse::Drag::asking;
    mouse.last_press = twice ? -1 : s.now;
    mouse.press_x = event.x, mouse.press_y = event.y;
    request(s.loaded.picker, s.loaded.sim.current_positions().id(), ray_at(s, view, event.x, event.y));
  }
}

void release(Session& s, Mouse& mouse, const Event& event) {
  if (event.code != mouse.button) return;
  if (mouse.drag == Mouse::Drag::orbit || mouse.drag == Mouse::Drag::pan)
    s.log("camera {:.2f} {:.2f} {:.4f} at {:.3f} {:.3f} {:.3f}", s.camera.azimuth, s.camera.elevation,
          s.camera.distance, s.camera.target.x, s.camera.target.y, s.camera.target.z);
  // A press that the picker has not answered yet is a click: it still counts for pinning, but catches
  // nothing.
  if (mouse.drag == Mouse::Drag::grab) let_go(s);
  mouse.drag = Mouse::Drag::none;
  mouse.button = -1;
}

void move(Session& s, Mouse& mouse, const Event& event, const Rect& view) {
  const float dx = float(event.x - mouse.x), dy = float(event.y - mouse.y);
  mouse.x = event.x, mouse.y = event.y;
  constexpr float degrees = 0.35f;  // a window coordinate: a turn of the wrist is half a turn of the view
  if (mouse.drag == Mouse::Drag::orbit) orbit(s.camera, -dx * degrees, dy * degrees);
  if (mouse.drag != Mouse::Drag::pan) return;
  const glm::vec3 before = s.camera.target;
  pan(s.camera, dx, dy, int(view.height));
  s.beside += s.camera.target - before;
}

void wheel(Session& s, const Mouse& mouse, const Event& event, const Rect& view) {
  if (!view.contains(mouse.x, mouse.y) || ImGui::GetIO().WantCaptureMouse) return;
  zoom(s.camera, std::pow(0.9f, float(event.y)));
  s.log("zoom {:.4f}", s.camera.distance);
}

void key(Session& s, Ui& ui, const Event& event) {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantTextInput || io.WantCaptureKeyboard) return;
  for (const Shortcut& shortcut : shortcuts()) {
    if (event.code != shortcut.key && (!shortcut.alternative || event.code != shortcut.alternative)) continue;
    if ((event.modifiers & (GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER)) != shortcut.modifiers)
      continue;
    shortcut.act(s, ui);
    return;
  }
}

void take_answer(Session& s, Mouse& mouse) {
  std::optional<Pick> pick;
  attempt(s, [&] { pick = poll(s.loaded.picker); });
  if (!pick) return;
  if (mouse.pinning) {
    mouse.pinning = false;
    if (pick->hit)
      toggle_pin(s, pick->vertex);
    else if (mouse.drag == Mouse::Drag::asking)
      mouse.drag = Mouse::Drag::orbit;
    return;
  }
  if (mouse.drag != Mouse::Drag::asking) return;
  if (pick->hit) attempt(s, [&] { catch_vertex(s, *pick); });
  mouse.drag = s.grab ? Mouse::Drag::grab : Mouse::Drag::orbit;
}

}  // namespace

void handle_input(Session& s, Ui& ui, Mouse& mouse, const Rect& view) {
  for (const Event& event : mouse.events) {
    if (event.kind == Event::Kind::key) key(s, ui, event);
    if (event.kind == Event::Kind::press) press(s, mouse, event, view);
    if (event.kind == Event::Kind::release) release(s, mouse, event);
    if (event.kind == Event::Kind::move) move(s, mouse, event, view);
    if (event.kind == Event::Kind::wheel) wheel(s, mouse, event, view);
  }
  mouse.events.clear();
  take_answer(s, mouse);
  if (mouse.drag == Mouse::Drag::grab && !s.grab)
    mouse.drag = Mouse::Drag::none;  // let go by a key or a new scene
  if (!s.grab) return;
  std::vector<glm::dvec4> planes = s.loaded.sim.model->obstacles;
  if (s.loaded.sim.settings.ground) planes.emplace_back(0.0, 1.0, 0.0, s.loaded.sim.settings.ground_height);
  aim(*s.grab, s.loaded.sim, s.camera, ray_at(s, view, mouse.x, mouse.y), planes);
}

bool is_busy(const Mouse& mouse) {
  return mouse.drag != Mouse::Drag::none || mouse.pinning || !mouse.events.empty();
}

}  // namespace tetpbd
