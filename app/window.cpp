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
#include <utility>

#include "app/files.h"
#include "app/input.h"
#include "app/session.h"
#include "app/ui.h"
#include "render/target.h"
#include "sim/error.h"

namespace tetpbd {

namespace {

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
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, std::getenv("TETPBD_GL_DEBUG") != nullptr);
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

void start_imgui(GLFWwindow* window) {
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

void take_screenshots(Session& s, View& view) {
  if (std::exchange(s.take_screenshot, false) && view.target.framebuffer) view.read_back.push(view.target);
  attempt(s, [&] {
    const auto image = view.read_back.poll();
    if (!image) return;
    std::string name;
    for (int i = 0; name.empty() || std::filesystem::exists(name); ++i)
      name = fmt::format("screenshot_{:03}.png", i);
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
  glClearColor(0.93f, 0.935f, 0.94f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (target.framebuffer) present(target, 0, 0, height - target.height);
  glViewport(0, 0, width, height);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(d.window);
}

// The first scene loads before there is anything to show, so this says what is going on.
void show_start(Session& s, Ui& ui, Desktop& d, const std::string& scene) {
  for (int frame = 0; frame < 2; ++frame) {  // the first has no size for what it places
    glfwPollEvents();
    measure_window(d, ui);
    const Layout layout = make_layout(ui, float(std::max(d.width, 1)), float(std::max(d.height, 1)));
    s.aspect = layout.view.width / layout.view.height;
    if (!d.visible) return;
    begin_imgui_frame();
    draw_busy(layout, scene);
    end_imgui_frame(d, {});
  }
}

void draw_frame(Session& s, Ui& ui, View& view, Input& input, const Desktop& d) {
  begin_imgui_frame();
  handle_input(input, make_layout(ui, float(d.width), float(d.height)).view);
  const Layout layout = make_layout(ui, float(d.width), float(d.height));  // a key can hide the panels
  const auto pixels = [&](float length) { return std::max(int(std::lround(length * d.density)), 1); };
  const int width = pixels(layout.view.width), height = pixels(layout.view.height);
  s.aspect = float(width) / float(height);
  draw_view(s, view, width, height);
  take_screenshots(s, view);
  const bool named = s.task.has_value();
  draw_ui(s, ui, layout);
  if (s.task) draw_busy(layout, s.task->name);
  end_imgui_frame(d, view.target);
  if (named) attempt(s, std::exchange(s.task, std::nullopt)->act);  // its name has been on the screen
}

}  // namespace

int run_window(const Scene& scene, const WindowOptions& options) {
  Desktop desktop(options.width, options.height, "tetpbd");
  Session s;  // after the desktop: its GL objects go before the context does
  s.gl = load_gl();
  if (const char* file = std::getenv("TETPBD_WINDOW_LOG")) s.log.file.open(file);
  s.samples = options.samples;
  s.view = options.view;
  s.view.follow = true;
  Ui ui;
  ui.mesh = options.overrides.mesh.string();
  Input input{s, ui};
  listen(desktop.window, input);
  start_imgui(desktop.window);
  show_start(s, ui, desktop, "loading " + scene.name);
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
    const bool idle = !s.playing && !moving && !input.busy() && !s.task && view.read_back.pending() == 0 &&
                      glfwGetTime() - last_event > 0.5;
    if (!desktop.visible || idle)
      glfwWaitEventsTimeout(0.1);
    else
      glfwPollEvents();
    measure_window(desktop, ui);
    s.now = glfwGetTime();
    if (!input.events.empty()) last_event = s.now;
    const double elapsed = s.now - std::exchange(before, s.now);
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
    draw_frame(s, ui, view, input, desktop);
  }
  s.log("closed");
  return 0;
}

}  // namespace tetpbd
