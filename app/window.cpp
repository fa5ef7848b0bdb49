// The window: GLFW and Dear ImGui around one simulation.
#include <GL/glew.h>
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "app/commands.h"
#include "app/edit_obstacles.h"
#include "app/files.h"
#include "app/session.h"
#include "app/ui.h"
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
  std::vector<std::function<void()>> events{};       ///< since the last frame, in order

  /// Something is under way that a frame must follow.
  bool busy() const { return drag != Drag::none || pinning || !events.empty() || session.loaded.probe.asked(); }
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
  if (in.drag == Drag::orbit) orbit(s.camera, -dx * degrees, dy * degrees);
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
    const bool twice = s.now - in.last_press < double_click && std::abs(in.x - in.press_x) < same_place &&
                       std::abs(in.y - in.press_y) < same_place;
    in.turning = modifiers & GLFW_MOD_CONTROL;
    in.pinning = twice || in.turning;
    in.drag = Drag::asking;
    in.last_press = twice ? -1 : s.now;
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

// Before Dear ImGui is started, which calls on what was installed. A queue of our own, since Dear ImGui
// forgets what came and went within a frame, and frames of a software renderer are long.
void listen(GLFWwindow* window, Input& input) {
  static const auto of = [](GLFWwindow* w) { return static_cast<Input*>(glfwGetWindowUserPointer(w)); };
  glfwSetWindowUserPointer(window, &input);
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int, int action, int modifiers) {
    // Held down, only the keys that step go on.
    const bool again = action == GLFW_REPEAT && (code == GLFW_KEY_S || code == GLFW_KEY_RIGHT || code == GLFW_KEY_LEFT);
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
  glfwSetCursorPosCallback(
      window, [](GLFWwindow* w, double x, double y) { of(w)->events.push_back([=, in = of(w)] { move(*in, x, y); }); });
  glfwSetDropCallback(window, [](GLFWwindow* w, int count, const char** files) {
    if (count > 0)
      of(w)->events.push_back([in = of(w), file = std::string(files[0])] { open_file(in->session, file); });
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double turned) {
    bool of_cut = false;  // as it is now, not in the next frame
    for (const int held : {GLFW_KEY_LEFT_ALT, GLFW_KEY_RIGHT_ALT, GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL})
      of_cut = of_cut || glfwGetKey(w, held) == GLFW_PRESS;
    of(w)->events.push_back([=, in = of(w)] { wheel(*in, turned, of_cut); });
  });
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

void begin_imgui_frame() {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
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
void show_start(Session& s, Desktop& d, const std::string& scene) {
  for (int frame = 0; frame < 2; ++frame) {  // the first has no size for what it places
    glfwPollEvents();
    measure_window(d, s);
    const Layout layout = make_layout(s.ui, float(std::max(d.width, 1)), float(std::max(d.height, 1)));
    s.aspect = layout.view.width / layout.view.height;
    if (!d.visible) return;
    begin_imgui_frame();
    draw_busy(layout, scene);
    end_imgui_frame(d, {});
  }
}

void draw_frame(Session& s, View& view, Input& input, const Desktop& d) {
  begin_imgui_frame();
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
  Desktop desktop(options.size[0], options.size[1], "tetpbd");
  Session s;  // after the desktop: its GL objects go before the context does
  s.gl = load_gl();
  count_gl_errors(print_gl_error);
  if (const char* file = std::getenv("TETPBD_WINDOW_LOG")) s.log.file.open(file);
  s.samples = options.samples;
  s.first_samples = options.samples;
  s.view = options.view;
  s.view.follow = true;
  s.first_view = s.view;
  const std::filesystem::path kept = cache_file("window.json");
  Preferences written = s.ui.kept = read_preferences(kept);
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
  ImGui_ImplGlfw_InitForOpenGL(desktop.window, true);
  ImGui_ImplOpenGL3_Init("#version 430 core");
  show_start(s, desktop, "loading " + scene.name);
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
    if (!input.events.empty()) last_event = s.now;
    const double elapsed = s.now - std::exchange(before, s.now);
    if (!desktop.visible) continue;
    if (!idle && ++frames > 2)
      s.frames_per_second.add(1 / std::max(elapsed, 1e-6), s.now);  // the first compile shaders
    if (desktop.width != last_width || desktop.height != last_height)
      s.log("size {} {}", last_width = desktop.width, last_height = desktop.height);
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
