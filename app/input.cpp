#include "app/input.h"

#include <GLFW/glfw3.h>

#include <cmath>
#include <utility>

namespace tetpbd {

namespace {

using Drag = Input::Drag;

constexpr double double_click = 0.35;  // s, the usual setting of desktops
constexpr double same_place = 6;       // window coordinates between the clicks of a double click

Ray ray_at_cursor(const Input& in) {
  // Only ratios count, so window coordinates do as well as pixels.
  return pixel_ray(in.session.camera, float(in.x) - in.view.x, float(in.y) - in.view.y, int(in.view.width),
                   int(in.view.height));
}

bool on_view(const Input& in) { return in.view.contains(in.x, in.y) && !ImGui::GetIO().WantCaptureMouse; }

void move(Input& in, double x, double y) {
  Session& s = in.session;
  const float dx = float(x - in.x), dy = float(y - in.y);
  in.x = x, in.y = y;
  constexpr float degrees = 0.35f;  // a window coordinate: a turn of the wrist is half a turn of the view
  if (in.drag == Drag::orbit) orbit(s.camera, -dx * degrees, dy * degrees);
  if (in.drag != Drag::pan) return;
  const glm::vec3 before = s.camera.target;
  pan(s.camera, dx, dy, int(in.view.height));
  s.beside += s.camera.target - before;
}

void press(Input& in, int button, int modifiers) {
  if (in.drag != Drag::none || !on_view(in)) return;
  Session& s = in.session;
  const bool left = button == GLFW_MOUSE_BUTTON_LEFT;
  in.button = button;
  if (button == GLFW_MOUSE_BUTTON_MIDDLE || (left && (modifiers & GLFW_MOD_SHIFT))) {
    in.drag = Drag::pan;
  } else if (button == GLFW_MOUSE_BUTTON_RIGHT) {
    in.drag = Drag::orbit;
  } else if (left) {
    const bool twice = s.now - in.last_press < double_click && std::abs(in.x - in.press_x) < same_place &&
                       std::abs(in.y - in.press_y) < same_place;
    in.pinning = twice || (modifiers & GLFW_MOD_CONTROL);
    in.drag = Drag::asking;
    in.last_press = twice ? -1 : s.now;
    in.press_x = in.x, in.press_y = in.y;
    request(s.loaded.picker, s.loaded.sim.positions.id(), ray_at_cursor(in));
  }
}

void release(Input& in, int button) {
  if (button != in.button) return;
  Session& s = in.session;
  const Camera& c = s.camera;
  if (in.drag == Drag::orbit || in.drag == Drag::pan)
    s.log("camera {:.2f} {:.2f} {:.4f} at {:.3f} {:.3f} {:.3f}", c.azimuth, c.elevation, c.distance,
          c.target.x, c.target.y, c.target.z);
  // A press that the picker has not answered yet is a click: it still counts for pinning, but catches
  // nothing.
  if (in.drag == Drag::grab) let_go(s);
  in.drag = Drag::none;
  in.button = -1;
}

void wheel(Input& in, double turned) {
  if (!on_view(in)) return;
  zoom(in.session.camera, std::pow(0.9f, float(turned)));
  in.session.log("zoom {:.4f}", in.session.camera.distance);
}

void key(Input& in, int code, int modifiers) {
  if (ImGui::GetIO().WantTextInput || ImGui::GetIO().WantCaptureKeyboard) return;
  modifiers &= GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER;
  for (const Shortcut& row : shortcuts())
    if ((code == row.key || code == row.alternative) && modifiers == row.modifiers)
      return row.act(in.session, in.ui);
}

void take_answer(Input& in) {
  Session& s = in.session;
  const auto pick = poll(s.loaded.picker);
  if (!pick) return;
  if (std::exchange(in.pinning, false)) {
    if (pick->hit)
      toggle_pin(s, pick->vertex);
    else if (in.drag == Drag::asking)
      in.drag = Drag::orbit;
  } else if (in.drag == Drag::asking) {
    if (pick->hit) catch_vertex(s, *pick);
    in.drag = s.grab ? Drag::grab : Drag::orbit;
  }
}

}  // namespace

void listen(GLFWwindow* window, Input& input) {
  static const auto of = [](GLFWwindow* w) { return static_cast<Input*>(glfwGetWindowUserPointer(w)); };
  glfwSetWindowUserPointer(window, &input);
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int, int action, int modifiers) {
    // Held down, only the key that steps goes on.
    const bool again = action == GLFW_REPEAT && (code == GLFW_KEY_S || code == GLFW_KEY_RIGHT);
    if (action == GLFW_PRESS || again)
      of(w)->events.push_back([in = of(w), code, modifiers] { key(*in, code, modifiers); });
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int modifiers) {
    double x = 0, y = 0;
    glfwGetCursorPos(w, &x, &y);
    of(w)->events.push_back([=, in = of(w)] {
      move(*in, x, y);
      action == GLFW_PRESS ? press(*in, button, modifiers) : release(*in, button);
    });
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    of(w)->events.push_back([=, in = of(w)] { move(*in, x, y); });
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double turned) {
    of(w)->events.push_back([=, in = of(w)] { wheel(*in, turned); });
  });
}

void handle_input(Input& in, const Rect& view) {
  in.view = view;
  for (const auto& event : std::exchange(in.events, {})) event();
  Session& s = in.session;
  attempt(s, [&] { take_answer(in); });
  if (in.drag == Drag::grab && !s.grab) in.drag = Drag::none;  // let go by a key or a new scene
  if (!s.grab) return;
  std::vector<glm::dvec4> planes = s.loaded.sim.model->obstacles;
  if (s.loaded.sim.settings.ground) planes.emplace_back(0.0, 1.0, 0.0, s.loaded.sim.settings.ground_height);
  aim(*s.grab, s.loaded.sim, s.camera, ray_at_cursor(in), planes);
}

}  // namespace tetpbd
