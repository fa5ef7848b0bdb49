#include "app/window/input.h"

#include <backends/imgui_impl_glfw.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <utility>

#include "app/window/edit_obstacles.h"
#include "app/window/ui.h"

namespace tetpbd {

namespace {

using Drag = Input::Drag;

constexpr double double_click = 0.35;  // s, the usual setting of desktops
constexpr double same_place = 6;       // window coordinates between the clicks of a double click

Ray ray_at_cursor(const Input& in, std::size_t lane) {
  // Only ratios count, so window coordinates do as well as pixels.
  const Rect tile = lane_place(in.session, lane, in.view);
  return pixel_ray(in.session.camera, float(in.x) - tile.x, float(in.y) - tile.y, int(tile.width), int(tile.height));
}

Ray ray_at_cursor(const Input& in) { return ray_at_cursor(in, in.session.loaded.chosen); }

std::size_t lane_at_cursor(const Input& in) {
  const Session& s = in.session;
  for (std::size_t lane = 0; lane < s.loaded.lanes.size() && !s.overlaid; ++lane)
    if (lane_place(s, lane, in.view).contains(in.x, in.y)) return lane;
  return s.loaded.chosen;
}

bool on_view(const Input& in) { return in.view.contains(in.x, in.y) && !ImGui::GetIO().WantCaptureMouse; }

// How far a drag takes the plane of the cut along its normal, as a part of the extent there.
double cut_moved(const Session& s, float dx, float dy, const Rect& place) {
  const Renderer& r = s.loaded.renderer;
  const glm::vec3 n = s.view.cut_direction();
  const glm::mat4 seen = projection_matrix(s.camera, place.width / place.height) * view_matrix(s.camera);
  const auto pixels = [&](const glm::vec3& p) {
    const glm::vec4 clip = seen * glm::vec4(p, 1);
    return glm::vec2(clip.x, -clip.y) / clip.w * 0.5f * glm::vec2(place.width, place.height);
  };
  const float extent = glm::dot(glm::abs(n), r.rest_high - r.rest_low);
  const glm::vec2 way = pixels(s.camera.target + 0.5f * extent * n) - pixels(s.camera.target - 0.5f * extent * n);
  // Where the normal points at the eye, up is into the picture.
  if (glm::length(way) < 0.1f * place.height) return double(dy / place.height);
  return double(glm::dot(glm::vec2(dx, dy), way) / glm::dot(way, way));
}

// Along the view's plane at the depth where it is held, or about the view's axes.
void drag_obstacle(Input& in, const Ray& before, float dx, float dy) {
  Session& s = in.session;
  const glm::dvec3 forward(glm::normalize(s.camera.target - eye(s.camera)));
  const auto held = [&](const Ray& ray) {
    const glm::dvec3 along(ray.direction);
    return glm::dvec3(ray.origin) + along * (in.depth / glm::dot(along, forward));
  };
  std::vector<Obstacle> wanted = asked_obstacles(s);
  Obstacle& o = wanted[std::size_t(s.obstacle)];
  if (in.axis) {
    glm::dvec3 way(0);
    way[*in.axis] = along_gizmo(s, lane_place(s, s.loaded.chosen, in.view), *in.axis, {dx, dy});
    move_by(o, way);
    return change_obstacles(s, std::move(wanted));
  }
  const glm::dvec3 right(glm::normalize(glm::cross(forward, glm::dvec3(0, 1, 0))));
  if (in.turning)
    turn_by(o, glm::dmat3(glm::rotate(glm::rotate(glm::dmat4(1), 0.01 * double(dx), glm::dvec3(0, 1, 0)),
                                      0.01 * double(dy), right)));
  else
    move_by(o, held(ray_at_cursor(in)) - held(before));
  change_obstacles(s, std::move(wanted));
}

void move(Input& in, double x, double y) {
  Session& s = in.session;
  const float dx = float(x - in.x), dy = float(y - in.y);
  if (dx != 0 || dy != 0) in.rested = s.now;
  const Ray ray_before = ray_at_cursor(in);
  in.x = x, in.y = y;
  if (in.drag == Drag::obstacle && (dx != 0 || dy != 0)) drag_obstacle(in, ray_before, dx, dy);
  constexpr float degrees = 0.35f;  // a window coordinate: a turn of the wrist is half a turn of the view
  if (in.drag == Drag::orbit) orbit(s.camera, -dx * degrees, dy * degrees), keep_above_ground(s);
  if (in.drag == Drag::cut) {
    const Rect place = lane_place(s, s.loaded.chosen, in.view);
    move_cut(s, cut_moved(s, dx, dy, place));
  }
  if (in.drag != Drag::pan) return;
  const glm::vec3 before = s.camera.target;
  const Rect place = lane_place(s, s.loaded.chosen, in.view);
  pan(s.camera, dx, dy, int(std::min(place.width, place.height)));
  s.beside += s.camera.target - before;
}

void press(Input& in, int button, int modifiers) {
  if (in.drag != Drag::none || !on_view(in)) return;
  Session& s = in.session;
  const bool left = button == GLFW_MOUSE_BUTTON_LEFT;
  in.button = button;
  choose_lane(s, lane_at_cursor(in));
  if (left && (modifiers & GLFW_MOD_ALT)) {
    in.drag = Drag::cut;
  } else if (button == GLFW_MOUSE_BUTTON_MIDDLE || (left && (modifiers & GLFW_MOD_SHIFT))) {
    in.drag = Drag::pan;
  } else if (button == GLFW_MOUSE_BUTTON_RIGHT) {
    in.drag = Drag::orbit;
  } else if (const auto axis = gizmo_at(s, lane_place(s, s.loaded.chosen, in.view), {float(in.x), float(in.y)});
             left && axis) {
    in.axis = axis, in.turning = false;
    in.drag = Drag::obstacle, s.moving_obstacle = true;
  } else if (left) {
    const bool twice = in.time - in.last_press < double_click && std::abs(in.x - in.press_x) < same_place &&
                       std::abs(in.y - in.press_y) < same_place;
    in.turning = modifiers & GLFW_MOD_CONTROL;
    in.pinning = twice || in.turning;
    in.drag = Drag::asking;
    in.last_press = twice ? -1 : in.time;
    in.press_x = in.x, in.press_y = in.y;
    request(s.loaded.picker, s.loaded.renderer, shown_frame(s, s.loaded.chosen), ray_at_cursor(in));
  }
}

void release(Input& in, int button) {
  if (button != in.button) return;
  Session& s = in.session;
  const Camera& c = s.camera;
  if (in.drag == Drag::cut) s.log("cut {:.4f}", s.view.cut);
  if (in.drag == Drag::orbit || in.drag == Drag::pan)
    note(s, action::SetCamera{c}), s.log("camera {:.2f} {:.2f} {:.4f} at {:.3f} {:.3f} {:.3f}", c.azimuth, c.elevation,
                                         c.distance, c.target.x, c.target.y, c.target.z);
  // A press that the picker has not answered yet is a click: it may still pin a vertex, but catches none.
  if (in.drag == Drag::grab) let_go(s);
  if (in.drag == Drag::obstacle) {
    const glm::dvec3& at = asked_obstacles(s)[std::size_t(s.obstacle)].centre;
    s.log("obstacle {} at {:.3f} {:.3f} {:.3f}", s.obstacle + 1, at.x, at.y, at.z);
    s.moving_obstacle = false;
  }
  in.drag = Drag::none;
  in.axis.reset();
  in.button = -1;
}

void wheel(Input& in, double turned, bool of_cut) {
  if (!on_view(in)) return;
  if (of_cut) {
    move_cut(in.session, 0.02 * turned);
    return in.session.log("cut {:.4f}", in.session.view.cut);
  }
  zoom(in.session.camera, std::pow(0.9f, float(turned)));
  note(in.session, action::SetCamera{in.session.camera});
  in.session.log("zoom {:.4f}", in.session.camera.distance);
}

void key(Input& in, int code, int modifiers) {
  // A slider that the mouse holds has no use for keys, though WantCaptureKeyboard claims them for it.
  if (ImGui::GetIO().WantTextInput) return;
  modifiers &= GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER | GLFW_MOD_SHIFT;
  if (modifiers == GLFW_MOD_SHIFT) modifiers = 0;
  for (const Shortcut& row : shortcuts())
    if ((code == row.key || code == row.alternative) && modifiers == row.modifiers) return row.act(in.session);
}

// Chosen by a click where no body is behind it, led by a drag once it is chosen, so that turning the view
// moves none. Whether the press is for it, or for nothing.
bool take_obstacle(Input& in, const Pick& pick) {
  Session& s = in.session;
  const Ray& ray = pick.ray;
  const auto hit = obstacle_on(s, ray);
  const bool chosen = hit && hit->number == s.obstacle, led = chosen && in.drag == Drag::asking;
  if (pick.hit && !(chosen && hit->distance < double(pick.distance))) return false;
  if (hit) choose_obstacle(s, hit->number);
  if (led) {
    s.moving_obstacle = true;
    in.depth = hit->distance * double(glm::dot(ray.direction, glm::normalize(s.camera.target - eye(s.camera))));
  }
  if (in.drag == Drag::asking) in.drag = led ? Drag::obstacle : Drag::orbit;
  return true;
}

// After a double click it is pinned; while the button is still down, caught.
void pin_or_catch(Input& in, const Pick& pick, bool pinning) {
  Session& s = in.session;
  if (pinning) return toggle_pin(s, pick.vertex);
  if (in.drag != Drag::asking) return;
  catch_vertex(s, pick);
  in.drag = s.grab ? Drag::grab : Drag::orbit;
}

void take_answer(Input& in) {
  Session& s = in.session;
  const auto pick = poll(s.loaded.picker);
  if (!pick) return;
  const bool pinning = std::exchange(in.pinning, false);
  if (take_obstacle(in, *pick)) return;
  between_steps(s, [&in, pick = *pick, pinning] { pin_or_catch(in, pick, pinning); });
}

// Asks what is under a cursor that has come to rest, and again when the picture there may have changed.
void hover(Input& in) {
  Session& s = in.session;
  Probe& probe = s.loaded.probe;
  constexpr double rest = 0.25;  // s
  if (!s.probing || in.drag != Drag::none || !on_view(in) || s.now - in.rested < rest) {
    probe.reading.reset(), probe.copied = {}, probe.picker.requested = {};
    in.seen = {};
    return;
  }
  const bool had = probe.reading.has_value();
  if (take_reading(probe, s.loaded.lanes) && probe.reading && !had)
    s.log("probe {} {} {:.4f} {:.4f} {:.4f}", probe.reading->vertex, probe.reading->tet, probe.reading->position.x,
          probe.reading->position.y, probe.reading->position.z);
  const std::size_t lane = lane_at_cursor(in);
  const Ray ray = ray_at_cursor(in, lane);
  const Seen now{ray.origin, ray.direction, s.loaded.lane().steps(), s.loaded.held, lane};
  if (probe.asked() || in.seen == now) return;
  in.seen = now;
  ask(probe, s.loaded.lanes, lane, s.loaded.renderer, shown_frame(s, lane), ray);
}

}  // namespace

// All that comes waits here for a frame. Dear ImGui 1.86 looks once a frame at what is down, and would forget what came
// and went between two frames, which are long with a software renderer.
void listen(GLFWwindow* window, Input& input) {
  static const auto of = [](GLFWwindow* w) { return static_cast<Input*>(glfwGetWindowUserPointer(w)); };
  glfwSetWindowUserPointer(window, &input);
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int scan, int action, int modifiers) {
    of(w)->waiting.push_back(
        {.kind = Event::Kind::key, .code = code, .scan = scan, .action = action, .modifiers = modifiers});
  });
  glfwSetCharCallback(window, [](GLFWwindow* w, unsigned text) {
    of(w)->waiting.push_back({.kind = Event::Kind::text, .code = int(text)});
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int modifiers) {
    Event event{.kind = Event::Kind::button, .code = button, .action = action, .modifiers = modifiers};
    glfwGetCursorPos(w, &event.x, &event.y);
    of(w)->waiting.push_back(event);
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    of(w)->waiting.push_back({.kind = Event::Kind::move, .x = x, .y = y});
  });
  glfwSetCursorEnterCallback(window, [](GLFWwindow* w, int entered) {
    if (!entered) of(w)->waiting.push_back({.kind = Event::Kind::move, .x = -1e6, .y = -1e6});
  });
  glfwSetDropCallback(window, [](GLFWwindow* w, int count, const char** files) {
    if (count > 0) of(w)->waiting.push_back({.kind = Event::Kind::drop, .file = files[0]});
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double across, double turned) {
    Event event{.kind = Event::Kind::scroll, .x = across, .y = turned};
    for (const int held : {GLFW_KEY_LEFT_ALT, GLFW_KEY_RIGHT_ALT, GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL})
      event.of_cut = event.of_cut || glfwGetKey(w, held) == GLFW_PRESS;
    of(w)->waiting.push_back(event);
  });
  glfwSetWindowFocusCallback(window, ImGui_ImplGlfw_WindowFocusCallback);
}

namespace {

void show_to_imgui(Input& in, GLFWwindow* window, const Event& e) {
  using Kind = Event::Kind;
  if (e.kind == Kind::key) ImGui_ImplGlfw_KeyCallback(window, e.code, e.scan, e.action, e.modifiers);
  if (e.kind == Kind::text) ImGui_ImplGlfw_CharCallback(window, unsigned(e.code));
  if (e.kind == Kind::scroll) ImGui_ImplGlfw_ScrollCallback(window, e.x, e.y);
  if (e.kind == Kind::move || e.kind == Kind::button) in.cursor = ImVec2(float(e.x), float(e.y));
  if (e.kind == Kind::button && e.code < int(in.down.size())) in.down[std::size_t(e.code)] = e.action == GLFW_PRESS;
}

// For what is no widget's.
void show_to_view(Input& in, const Event& e) {
  in.time = e.time;
  switch (e.kind) {
    case Event::Kind::key: {
      // Held down, only the keys that step go on.
      const bool steps = e.code == GLFW_KEY_S || e.code == GLFW_KEY_RIGHT || e.code == GLFW_KEY_LEFT;
      if (e.action == GLFW_PRESS || (e.action == GLFW_REPEAT && steps)) key(in, e.code, e.modifiers);
      break;
    }
    case Event::Kind::button:
      move(in, e.x, e.y);
      e.action == GLFW_PRESS ? press(in, e.code, e.modifiers) : release(in, e.code);
      break;
    case Event::Kind::move:
      move(in, e.x, e.y);
      break;
    case Event::Kind::scroll:
      wheel(in, e.y, e.of_cut);
      break;
    case Event::Kind::drop:
      open_file(in.session, e.file);
      break;
    case Event::Kind::text:
      break;
  }
}

}  // namespace

// A button or a key that went down stays so for a frame, the cursor where it was when a button changed, and what is
// typed after a key that acts, such as Enter, waits for what that does.
void feed(Input& in, GLFWwindow* window) {
  bool clicked = false, acted = false;
  std::vector<int> keys;
  using Kind = Event::Kind;
  while (!in.waiting.empty()) {
    const Event e = in.waiting.front();
    const bool changes = e.kind == Kind::key && e.action != GLFW_REPEAT, presses = changes && e.action == GLFW_PRESS;
    if (clicked && (e.kind == Kind::move || e.kind == Kind::button)) break;
    if (changes && std::ranges::count(keys, e.code)) break;
    if (acted && (presses || e.kind == Kind::text || e.kind == Kind::button)) break;
    in.waiting.pop_front();
    clicked = clicked || e.kind == Kind::button;
    if (changes) keys.push_back(e.code);
    const bool modifier = e.code >= GLFW_KEY_LEFT_SHIFT && e.code <= GLFW_KEY_RIGHT_SUPER;
    const bool writes = e.code < 256 && !(e.modifiers & (GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER));
    acted = acted || (presses && !modifier && !writes);
    show_to_imgui(in, window, e);
    in.events.push_back([&in, e] { show_to_view(in, e); });
  }
}

void handle_input(Input& in, const Rect& view) {
  in.view = view;
  for (const auto& event : std::exchange(in.events, {})) event();
  Session& s = in.session;
  attempt(s, [&] { take_answer(in), hover(in); });
  if (in.drag == Drag::grab && !s.grab) in.drag = Drag::none;  // let go by a key or a new scene
  if (in.drag == Drag::obstacle && s.obstacle < 0) in.drag = Drag::none, s.moving_obstacle = false;
  if (!s.grab) return;
  aim(*s.grab, s.loaded.lane(), s.camera, ray_at_cursor(in));
}

}  // namespace tetpbd
