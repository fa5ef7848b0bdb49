#include "app/window.h"

#include <GL/glew.h>
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "app/files.h"
#include "app/input.h"
#include "app/session.h"
#include "app/ui.h"
#include "render/target.h"
#include "sim/error.h"

namespace tetpbd {

namespace {

const char* variable(const char* name) {
  const char* value = std::getenv(name);
  return value && *value ? value : nullptr;
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
  float density = 1;          ///< framebuffer pixels a window coordinate: more on some dense displays
  bool visible = false;       ///< not minimised
  float style_scale = 0, style_density = 0;  ///< what the style was made for

  Desktop(int wanted_width, int wanted_height, const std::string& title) {
    if (!glfwInit())
      throw Error("no display", last_glfw_error(), "start it in a desktop session, or use tetpbd run");
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);  // where the driver can
    glfwWindowHint(GLFW_SAMPLES, 0);                                      // the view has its own target
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    const char* debug = variable("TETPBD_GL_DEBUG");
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, debug && std::string(debug) != "0");
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

Mouse& mouse_of(GLFWwindow* window) { return *static_cast<Mouse*>(glfwGetWindowUserPointer(window)); }

// Installed before Dear ImGui's, which call them and then do their own. A queue of our own, since Dear ImGui
// forgets what came and went within a frame, and frames of a software renderer are long.
void listen(GLFWwindow* window, Mouse& mouse) {
  glfwSetWindowUserPointer(window, &mouse);
  glfwSetKeyCallback(window, [](GLFWwindow* w, int code, int, int action, int modifiers) {
    // Held down, only the key that steps goes on.
    const bool again = action == GLFW_REPEAT && (code == GLFW_KEY_S || code == GLFW_KEY_RIGHT);
    if (action == GLFW_PRESS || again)
      mouse_of(w).events.push_back({Event::Kind::key, code, modifiers, 0, 0});
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int code, int action, int modifiers) {
    double x = 0, y = 0;
    glfwGetCursorPos(w, &x, &y);
    const auto kind = action == GLFW_PRESS ? Event::Kind::press : Event::Kind::release;
    mouse_of(w).events.push_back({Event::Kind::move, 0, 0, x, y});
    mouse_of(w).events.push_back({kind, code, modifiers, x, y});
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
    mouse_of(w).events.push_back({Event::Kind::move, 0, 0, x, y});
  });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double x, double y) {
    mouse_of(w).events.push_back({Event::Kind::wheel, 0, 0, x, y});
  });
}

void start_imgui(GLFWwindow* window) {
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;  // no file is left behind
  ImGui_ImplGlfw_InitForOpenGL(window, true);
  ImGui_ImplOpenGL3_Init("#version 430 core");
}

// Sizes of this frame, and a style for them: another monitor can have another scale.
void measure_window(Desktop& d, Ui& ui) {
  int pixels_x = 0, pixels_y = 0;
  glfwGetWindowSize(d.window, &d.width, &d.height);
  glfwGetFramebufferSize(d.window, &pixels_x, &pixels_y);
  d.visible = pixels_x > 0 && pixels_y > 0 && d.width > 0 && d.height > 0 &&
              !glfwGetWindowAttrib(d.window, GLFW_ICONIFIED);
  if (!d.visible) return;
  d.density = float(pixels_x) / float(d.width);
  float content = 1;
  glfwGetWindowContentScale(d.window, &content, nullptr);
  ui.scale = std::clamp(content / d.density, 0.5f, 4.0f);
  if (ui.scale == d.style_scale && d.density == d.style_density) return;
  d.style_scale = ui.scale, d.style_density = d.density;
  set_style(ui.scale, d.density);
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
  Frame frame = frame_of(s.loaded.sim, s.camera, s.view, view.target);
  if (s.grab) frame.grabbed.push_back(s.grab->vertex);
  if (attempt(s, [&] { draw(s.loaded.renderer, frame); })) {
    view.drawn = s.view;
  } else {
    s.view = view.drawn;  // a look whose shaders do not compile is left again
  }
}

std::string next_screenshot() {
  std::error_code ignored;
  for (int i = 0;; ++i) {
    const std::string name = fmt::format("screenshot_{:03}.png", i);
    if (!std::filesystem::exists(name, ignored)) return name;
  }
}

void take_screenshots(Session& s, View& view) {
  if (s.take_screenshot && view.target.framebuffer) view.read_back.push(view.target);
  s.take_screenshot = false;
  attempt(s, [&] {
    if (const auto image = view.read_back.poll()) {
      const std::string name = next_screenshot();
      write_png(name, *image);
      s.log("screenshot {}", name);
      say(s, "saved " + name);
    }
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
  glClearColor(0.93f, 0.935f, 0.94f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (target.framebuffer) present(target, 0, 0, height - target.height);
  glViewport(0, 0, width, height);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(d.window);
}

// The first scene loads before there is anything to show, so this says what is going on.
void show_start(Desktop& d, Ui& ui, const std::string& what) {
  for (int frame = 0; frame < 2; ++frame) {  // the first has no size for what it places
    glfwPollEvents();
    measure_window(d, ui);
    if (!d.visible) return;
    begin_imgui_frame();
    draw_busy(make_layout(ui, float(d.width), float(d.height)), what);
    end_imgui_frame(d, {});
  }
}

void draw_frame(Session& s, Ui& ui, View& view, Mouse& mouse, const Desktop& d) {
  begin_imgui_frame();
  handle_input(s, ui, mouse, make_layout(ui, float(d.width), float(d.height)).view);
  const Layout layout = make_layout(ui, float(d.width), float(d.height));  // a key can hide the panels
  const auto pixels = [&](float length) { return std::max(int(std::lround(length * d.density)), 1); };
  const int width = pixels(layout.view.width), height = pixels(layout.view.height);
  s.aspect = float(width) / float(height);
  draw_view(s, view, width, height);
  take_screenshots(s, view);
  const bool load_now = s.loading.has_value(), choose_now = s.choosing;
  draw_ui(s, ui, layout);
  if (s.loading) {
    const std::string mesh = s.loading->overrides.mesh.string();
    draw_busy(layout, "loading " + (mesh.empty() ? s.loading->name : mesh));
  } else if (s.choosing) {
    draw_busy(layout, "trying ways to solve");
  }
  end_imgui_frame(d, view.target);
  // Their messages have been on the screen for a frame.
  if (load_now)
    finish_loading(s);
  else if (choose_now)
    finish_choosing(s);
}

}  // namespace

int run_window(const Scene& scene, const WindowOptions& options) {
  Desktop desktop(options.width, options.height, "tetpbd");
  Mouse mouse;
  listen(desktop.window, mouse);
  Session s;  // after the desktop: its GL objects go before the context does
  s.gl = load_gl();
  if (const char* file = variable("TETPBD_WINDOW_LOG")) s.log.file.open(file);
  s.samples = options.samples;
  s.view = options.view;
  s.view.follow = true;
  Ui ui;
  ui.mesh = options.overrides.mesh.string();
  start_imgui(desktop.window);
  show_start(desktop, ui, scene.name);
  const Rect first =
      make_layout(ui, float(std::max(desktop.width, 1)), float(std::max(desktop.height, 1))).view;
  s.aspect = first.width / first.height;
  take_over(s, load(options.scene_name, options.overrides, scene), false);

  View view;
  view.drawn = s.view;
  bool vsync = !s.vsync, moving = false;  // moving: the camera
  std::string title;
  int last_width = 0, last_height = 0;
  long frames = 0;
  double before = glfwGetTime(), last_check = before, last_event = before;
  s.log("ready");
  while (!glfwWindowShouldClose(desktop.window) && !s.quit) {
    // With nothing moving, a few frames a second are enough and the processor can rest.
    const bool idle = !s.playing && !moving && !is_busy(mouse) && !s.loading && !s.choosing &&
                      view.read_back.pending() == 0 && glfwGetTime() - last_event > 0.5;
    if (!desktop.visible || idle)
      glfwWaitEventsTimeout(0.1);
    else
      glfwPollEvents();
    measure_window(desktop, ui);
    s.now = glfwGetTime();
    if (!mouse.events.empty()) last_event = s.now;
    const double elapsed = s.now - before;
    before = s.now;
    if (!desktop.visible) continue;
    if (!idle && ++frames > 2)
      s.frames_per_second.add(1 / std::max(elapsed, 1e-6));  // the first compile shaders
    if (desktop.width != last_width || desktop.height != last_height)
      s.log("size {} {}", last_width = desktop.width, last_height = desktop.height);
    if (s.loaded.scene.name != title)
      glfwSetWindowTitle(desktop.window, ((title = s.loaded.scene.name) + " - tetpbd").c_str());
    if (s.vsync != vsync) glfwSwapInterval((vsync = s.vsync) ? 1 : 0);
    s.measuring = ui.panels && ui.plots;
    const long steps = s.loaded.sim.steps;
    if (!attempt(s, [&] {
          advance(s, elapsed);
          watch_state(s);
          measure_frame(s, s.loaded.sim.steps != steps);
        }))
      ui.plots = false, play(s, false);  // said once, not every frame
    moving = follow_bodies(s, elapsed);
    if (s.now - last_check > 0.5) {
      last_check = s.now;
      follow_shaders(s);
    }
    draw_frame(s, ui, view, mouse, desktop);
  }
  s.log("closed");
  return 0;
}

}  // namespace tetpbd
