// The window: GLFW and Dear ImGui around one simulation.
#include <GL/glew.h>
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "app/commands.h"
#include "app/files.h"
#include "app/window/edit_obstacles.h"
#include "app/window/session.h"
#include "app/window/ui.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/cache.h"

namespace tetpbd {

namespace {

// Mouse and keyboard on the view: what a drag does is decided once the GPU has said what is under the cursor.

/// What a picture under the cursor depends on.
struct Seen {
  glm::vec3 origin{0}, direction{0};
  long step = -1, held = -1;
  std::size_t lane = 0;
  bool operator==(const Seen&) const = default;
};

/// What came from the desktop, as it came.
struct Event {
  enum class Kind { key, text, button, move, scroll, drop } kind;
  int code = 0, scan = 0, action = 0, modifiers = 0;  ///< as GLFW has them; of a button and of text in `code`
  double x = 0, y = 0;                                ///< cursor; of a scroll how far it was turned
  bool of_cut = false;                                ///< a scroll with Alt or Ctrl
  std::string file{};
  double time = glfwGetTime();
};

struct Input {
  Session& session;
  Rect view{};
  /// `asking`: pressed, and the picker has not answered yet.
  enum class Drag { none, asking, grab, orbit, pan, cut, obstacle } drag = Drag::none;
  bool pinning = false;                              ///< the question is for a vertex to pin
  bool turning = false;                              ///< what is dragged, in place of moving it
  double depth = 0;                                  ///< m, of the place by which an obstacle is held
  int button = -1;                                   ///< that holds the drag
  double x = 0, y = 0;                               ///< cursor, as far as events have been handled
  double last_press = -1, press_x = 0, press_y = 0;  ///< s, and where: for double clicks
  Seen seen{};                                       ///< by the probe
  double rested = 0;                                 ///< s, since when the cursor is where it is
  std::deque<Event> waiting{};                       ///< that no frame has seen
  std::vector<std::function<void()>> events{};       ///< of this frame, in order
  ImVec2 cursor{-FLT_MAX, -FLT_MAX};                 ///< as Dear ImGui is told
  std::array<bool, 3> down{};                        ///< buttons, likewise
  double time = 0;                                   ///< s, of the event that is handled

  /// Something is under way that a frame must follow.
  bool busy() const { return drag != Drag::none || pinning || !waiting.empty() || session.loaded.probe.asked(); }
};

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
  std::vector<Obstacle> wanted = s.loaded.scene.obstacles;
  Obstacle& o = wanted[std::size_t(s.obstacle)];
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
    note_camera(s), s.log("camera {:.2f} {:.2f} {:.4f} at {:.3f} {:.3f} {:.3f}", c.azimuth, c.elevation, c.distance,
                          c.target.x, c.target.y, c.target.z);
  // A press that the picker has not answered yet is a click: it may still pin a vertex, but catches none.
  if (in.drag == Drag::grab) let_go(s);
  if (in.drag == Drag::obstacle) {
    const glm::dvec3& at = s.loaded.scene.obstacles[std::size_t(s.obstacle)].centre;
    s.log("obstacle {} at {:.3f} {:.3f} {:.3f}", s.obstacle + 1, at.x, at.y, at.z);
    s.moving_obstacle = false;
  }
  in.drag = Drag::none;
  in.button = -1;
}

void wheel(Input& in, double turned, bool of_cut) {
  if (!on_view(in)) return;
  if (of_cut) {
    move_cut(in.session, 0.02 * turned);
    return in.session.log("cut {:.4f}", in.session.view.cut);
  }
  zoom(in.session.camera, std::pow(0.9f, float(turned)));
  note_camera(in.session);
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

void take_answer(Input& in) {
  Session& s = in.session;
  const auto pick = poll(s.loaded.picker);
  if (!pick) return;
  const bool pinning = std::exchange(in.pinning, false);
  if (take_obstacle(in, *pick)) return;
  if (pinning) return toggle_pin(s, pick->vertex);
  if (in.drag != Drag::asking) return;
  catch_vertex(s, *pick);
  in.drag = s.grab ? Drag::grab : Drag::orbit;
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
  const Seen now{ray.origin, ray.direction, s.loaded.sim().steps, s.loaded.held, lane};
  if (probe.asked() || in.seen == now) return;
  in.seen = now;
  ask(probe, s.loaded.lanes, lane, s.loaded.renderer, shown_frame(s, lane), ray);
}

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

// Before ImGui::NewFrame(): as many of the events that wait as one frame can tell apart. A button or a key that went
// down stays so for a frame, the cursor where it was when a button changed, and what is typed after a key that acts,
// such as Enter, waits for what that does.
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

// After ImGui::NewFrame(), which knows whose the cursor and the keys are.
void handle_input(Input& in, const Rect& view) {
  in.view = view;
  for (const auto& event : std::exchange(in.events, {})) event();
  Session& s = in.session;
  attempt(s, [&] { take_answer(in), hover(in); });
  if (in.drag == Drag::grab && !s.grab) in.drag = Drag::none;  // let go by a key or a new scene
  if (in.drag == Drag::obstacle && s.obstacle < 0) in.drag = Drag::none, s.moving_obstacle = false;
  if (!s.grab) return;
  const Sim& sim = s.loaded.sim();
  aim(*s.grab, sim, s.camera, ray_at_cursor(in));
}

std::string last_glfw_error() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text ? text : "no reason given";
}

/// GLFW, a window with a GL 4.3 core context, and Dear ImGui in it.
struct Desktop {
  GLFWwindow* window = nullptr;
  int width = 0, height = 0;  ///< of this frame, in window coordinates
  float density = 0;          ///< framebuffer pixels a window coordinate: more on some dense displays
  bool dark = false;          ///< the theme, as far as it is set
  bool visible = false;       ///< not minimised

  Desktop(int wanted_width, int wanted_height, const std::string& title) {
    if (!glfwInit()) throw Error("no display", last_glfw_error(), "start it in a desktop session, or use tetpbd run");
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);  // where the driver can
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    const char* debug = std::getenv("TETPBD_GL_DEBUG");
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, debug && std::string_view(debug) != "0");
    window = glfwCreateWindow(wanted_width, wanted_height, title.c_str(), nullptr, nullptr);
    if (!window) {
      const std::string reason = last_glfw_error();
      glfwTerminate();
      throw Error("no window with OpenGL 4.3", reason, "use a newer driver, or tetpbd run", 1);
    }
    glfwSetWindowSizeLimits(window, 480, 320, GLFW_DONT_CARE, GLFW_DONT_CARE);
    glfwMakeContextCurrent(window);
  }
  ~Desktop() {
    if (ImGui::GetCurrentContext()) {
      ImGui_ImplOpenGL3_Shutdown();
      ImGui_ImplGlfw_Shutdown();
      ImGui::DestroyContext();
    }
    glfwDestroyWindow(window);
    glfwTerminate();
  }
  Desktop(const Desktop&) = delete;
  Desktop& operator=(const Desktop&) = delete;
};

// Sizes of this frame, and a style for them: another monitor can have another scale.
void measure_window(Desktop& d, Session& s) {
  int pixels_x = 0, pixels_y = 0;
  glfwGetWindowSize(d.window, &d.width, &d.height);
  glfwGetFramebufferSize(d.window, &pixels_x, &pixels_y);
  d.visible =
      pixels_x > 0 && pixels_y > 0 && d.width > 0 && d.height > 0 && !glfwGetWindowAttrib(d.window, GLFW_ICONIFIED);
  if (!d.visible) return;
  const std::tuple before(s.ui.scale, d.density, d.dark);
  // A window that is resized between the two questions has no such density, and no font of that size.
  d.density = std::clamp(float(pixels_x) / float(d.width), 0.5f, 4.0f);
  float content = 1;
  glfwGetWindowContentScale(d.window, &content, nullptr);
  s.ui.scale = std::clamp(content / d.density, 0.5f, 4.0f) * float(s.ui.kept.text);
  d.dark = s.ui.kept.dark;
  if (before == std::tuple(s.ui.scale, d.density, d.dark)) return;
  s.log("scale {} {}", s.ui.scale, d.dark ? "dark" : "light");
  set_style(s.ui.scale, d.density, d.dark);
  ImGui_ImplOpenGL3_DestroyFontsTexture();
  ImGui_ImplOpenGL3_CreateFontsTexture();
}

/// The image of the view, without panels, and screenshots on their way to a file.
struct View {
  Target target;
  int asked_samples = -1;
  ViewOptions drawn;  ///< the last that could be drawn
  ReadBack read_back;
};

void draw_view(Session& s, View& view, int width, int height) {
  if (view.target.width != width || view.target.height != height || view.asked_samples != s.samples) {
    view.asked_samples = s.samples;
    attempt(s, [&] {
      view.target = {};  // first, so that a large window does not need both at once
      view.target = make_target(width, height, s.samples);
    });
  }
  if (!view.target.framebuffer) return;
  if (attempt(s, [&] { draw_lanes(s, view.target); })) {
    view.drawn = s.view;
  } else {
    s.view = view.drawn;  // a look whose shaders do not compile is left again
  }
}

void take_screenshots(Session& s, View& view) {
  if (std::exchange(s.take_screenshot, false) && view.target.framebuffer) view.read_back.push(view.target);
  attempt(s, [&] {
    const auto image = view.read_back.poll();
    if (!image) return;
    const std::string name = free_name("screenshot", "png");
    write_png(name, *image);
    s.log("screenshot {}", name);
    say(s, "saved " + name);
  });
}

void begin_imgui_frame(Input& input, GLFWwindow* window) {
  feed(input, window);
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  // In place of what is down now, which some events that wait may have changed.
  ImGuiIO& io = ImGui::GetIO();
  io.MousePos = input.cursor;
  std::ranges::copy(input.down, io.MouseDown);
  ImGui::NewFrame();
}

// Shows the view's image, if there is one, and the panels.
void end_imgui_frame(const Desktop& d, const Target& target) {
  ImGui::Render();
  const int width = int(float(d.width) * d.density), height = int(float(d.height) * d.density);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glDisable(GL_SCISSOR_TEST);
  d.dark ? glClearColor(0.06f, 0.06f, 0.06f, 1) : glClearColor(0.93f, 0.935f, 0.94f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (target.framebuffer) present(target, 0, 0, height - target.height);
  glViewport(0, 0, width, height);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(d.window);
}

// The first scene loads before there is anything to show, so this says what is going on.
void show_start(Session& s, Input& input, Desktop& d, const std::string& scene) {
  for (int frame = 0; frame < 2; ++frame) {  // the first has no size for what it places
    glfwPollEvents();
    measure_window(d, s);
    const Layout layout = make_layout(s.ui, float(std::max(d.width, 1)), float(std::max(d.height, 1)));
    s.aspect = layout.view.width / layout.view.height;
    if (!d.visible) return;
    begin_imgui_frame(input, d.window);
    input.events.clear();  // there is nothing yet for them
    draw_busy(layout, scene);
    end_imgui_frame(d, {});
  }
}

void draw_frame(Session& s, View& view, Input& input, const Desktop& d) {
  begin_imgui_frame(input, d.window);
  handle_input(input, make_layout(s.ui, float(d.width), float(d.height)).view);
  const Layout layout = make_layout(s.ui, float(d.width), float(d.height));  // a key can hide the panels
  const auto pixels = [&](float length) { return std::max(int(std::lround(length * d.density)), 1); };
  const int width = pixels(layout.view.width), height = pixels(layout.view.height);
  const Viewport tile = tile_in(s, 0, width, height);
  s.aspect = float(tile.width) / float(tile.height);
  find_worst(s);
  draw_view(s, view, width, height);
  take_screenshots(s, view);
  const bool named = s.task.has_value();
  draw_ui(s, layout);
  if (s.task) draw_busy(layout, s.task->name);
  end_imgui_frame(d, view.target);
  if (named) attempt(s, std::exchange(s.task, std::nullopt)->act);  // its name has been on the screen
}

}  // namespace

int run_window(const Scene& scene, const std::string& name, const SceneOverrides& overrides,
               const RunOptions& options) {
  const std::filesystem::path kept = cache_file("window.json");
  const Preferences before_now = read_preferences(kept);
  const RunOptions usual_options;
  const bool as_before = options.size == usual_options.size && before_now.width > 0;
  Desktop desktop(as_before ? before_now.width : options.size[0], as_before ? before_now.height : options.size[1],
                  "tetpbd");
  Session s;  // after the desktop: its GL objects go before the context does
  s.gl = load_gl();
  count_gl_errors(print_gl_error);
  if (const char* file = std::getenv("TETPBD_WINDOW_LOG")) s.log.file.open(file);
  Preferences written = s.ui.kept = before_now;
  s.view = options.view;
  s.view.follow = true;
  // A software renderer draws without what costs most, unless somebody has chosen.
  s.view.shadow = s.view.shadow && (s.ui.kept.shadow < 0 ? !s.gl.software : s.ui.kept.shadow != 0);
  s.samples = options.samples;
  if (options.samples == usual_options.samples)
    s.samples = s.ui.kept.samples >= 0 ? s.ui.kept.samples : s.gl.software ? 0 : s.samples;
  s.first_samples = s.samples;
  s.first_view = s.view;
  constexpr int first_runs = 3;
  if (s.ui.kept.hints < first_runs && options.lanes.empty()) ++s.ui.kept.hints, s.hints_until = 25;
  // What cannot be kept is not worth a word.
  const auto keep = [&] {
    if (written == s.ui.kept || kept.empty()) return;
    written = s.ui.kept;
    try {
      write_preferences(kept, written);
    } catch (const std::exception&) {
    }
  };
  s.ui.mesh = overrides.mesh.string();
  s.timeline.budget = std::size_t(options.history_mb) << 20;
  if (!options.record.empty()) s.record = std::make_unique<Record>(options.record);
  Input input{s};
  listen(desktop.window, input);
  ImGui::CreateContext();
  ImGui_ImplGlfw_InitForOpenGL(desktop.window, false);
  ImGui_ImplOpenGL3_Init("#version 430 core");
  show_start(s, input, desktop, "loading " + scene.name);
  take_over(s, load(name, overrides, scene), false);
  if (!options.lanes.empty()) compare_lanes(s, options.lanes);

  View view;
  view.drawn = s.view;
  bool vsync = !s.vsync, moving = false;  // moving: the camera
  std::string title;
  int last_width = 0, last_height = 0;
  long frames = 0;
  double before = glfwGetTime(), last_check = before, last_event = before;
  s.log("ready");
  if (s.hints_until > 0) s.hints_until += before;
  while (!glfwWindowShouldClose(desktop.window) && !s.quit && !interrupted()) {
    // With nothing moving, a few frames a second are enough and the processor can rest.
    const bool idle = !s.playing && !is_filling(s) && !moving && !input.busy() && !s.task &&
                      view.read_back.pending() == 0 && glfwGetTime() - last_event > 0.5;
    if (!desktop.visible || idle)
      glfwWaitEventsTimeout(0.1);
    else
      glfwPollEvents();
    measure_window(desktop, s);
    s.now = glfwGetTime();
    if (!input.waiting.empty()) last_event = s.now;
    const double elapsed = s.now - std::exchange(before, s.now);
    if (!desktop.visible) continue;
    if (!idle && ++frames > 2)
      s.frames_per_second.add(1 / std::max(elapsed, 1e-6), s.now);  // the first compile shaders
    if (desktop.width != last_width || desktop.height != last_height) {
      if (last_width > 0) s.ui.kept.width = desktop.width, s.ui.kept.height = desktop.height;
      s.log("size {} {}", last_width = desktop.width, last_height = desktop.height);
    }
    if (s.loaded.scene.name != title)
      glfwSetWindowTitle(desktop.window, ((title = s.loaded.scene.name) + " - tetpbd").c_str());
    if (s.vsync != vsync) glfwSwapInterval((vsync = s.vsync) ? 1 : 0);
    s.measuring = s.ui.panels && s.ui.plots;
    const double simulated = s.clock.simulated;
    if (!attempt(s, [&] {
          advance(s, elapsed);
          watch_state(s);
          measure_frame(s, s.clock.simulated != simulated);
        }))
      s.ui.plots = false, play(s, false);  // said once, not every frame
    fill_map(s);
    moving = follow_bodies(s, elapsed);
    if (s.now - last_check > 0.5) {
      last_check = s.now;
      follow_shaders(s);
      keep();
    }
    draw_frame(s, view, input, desktop);
  }
  end_record(s);
  keep();
  s.log("closed");
  return 0;
}

}  // namespace tetpbd
