// The window: GLFW and Dear ImGui around one simulation.
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <limits>
#include <memory>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "app/commands.h"
#include "app/files.h"
#include "app/lab/progress.h"
#include "app/window/input.h"
#include "app/window/session.h"
#include "app/window/ui.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/cache.h"

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

/// A video of the view as it is seen.
struct Filming {
  static constexpr int rate = 30;  // frames a second
  std::string file;
  Video video;
  int width, height;
  double next;  ///< s, when the next frame is due
  ReadBack images{};
  std::deque<int> times{};  ///< how often each image that is on its way is shown

  Filming(const std::string& name, const Target& target, double now)
      : file(name),
        video(name, target.width, target.height, rate),
        width(target.width),
        height(target.height),
        next(now) {}
};

/// The image of the view, without panels, and screenshots on their way to a file.
struct View {
  Target target;
  int asked_samples = -1;
  ViewOptions drawn;  ///< the last that could be drawn
  ReadBack read_back;
  std::unique_ptr<Filming> filming{};
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

void take_frames(Filming& film, std::size_t most_pending) {
  while (const auto image = film.images.poll(film.images.pending() > most_pending)) {
    for (int k = 0; k < film.times.front(); ++k) film.video.add(*image);
    film.times.pop_front();
  }
}

void end_film(Session& s, View& view) {
  s.filming = false;
  const auto film = std::exchange(view.filming, nullptr);
  if (!film) return;
  attempt(s, [&] {
    take_frames(*film, 0);
    film->video.close();
    s.log("video {}", film->file);
    say(s, "saved " + film->file);
  });
}

// A frame that lasts is shown as often as its time asks for.
void film(Session& s, View& view) {
  if (s.filming && !view.target.framebuffer) return;
  auto& film = view.filming;
  if (!s.filming || (film && (film->width != view.target.width || film->height != view.target.height)))
    return end_film(s, view);
  const bool good = attempt(s, [&] {
    if (!film) {
      film = std::make_unique<Filming>(free_name("video", "mp4"), view.target, s.now);
      s.log("filming {}", film->file);
    }
    int times = 0;
    for (; film->next <= s.now; film->next += 1.0 / Filming::rate) ++times;
    if (times > 0) film->images.push(view.target), film->times.push_back(times);
    constexpr std::size_t most_pending = 6;
    take_frames(*film, most_pending);
  });
  if (!good) film.reset(), s.filming = false;
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
    draw_busy(s, layout, scene);
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
  film(s, view);
  const bool named = s.task.has_value();
  draw_ui(s, layout);
  if (s.task) draw_busy(s, layout, s.task->name);
  end_imgui_frame(d, view.target);
  // Its name has been on the screen.
  if (named && !s.under_way) attempt(s, std::exchange(s.task, std::nullopt)->act);
}

// What a task that lasts shows of itself, some ten times a second; only its own window listens.
void show_progress(Session& s, View& view, Input& input, Desktop& d, const std::string& what, double part) {
  if (const double now = glfwGetTime(); now - s.now < 0.1) return;
  s.now = glfwGetTime();
  glfwPollEvents();
  const bool escaped = std::ranges::any_of(input.waiting, [](const Event& e) {
    return e.kind == Event::Kind::key && e.code == GLFW_KEY_ESCAPE && e.action == GLFW_PRESS;
  });
  measure_window(d, s);
  if (!d.visible) return;
  begin_imgui_frame(input, d.window);
  input.events.clear();
  const bool cancelled = draw_busy(s, make_layout(s.ui, float(d.width), float(d.height)), what, part);
  end_imgui_frame(d, view.target);
  if (cancelled || escaped || glfwWindowShouldClose(d.window) || interrupted()) throw Interrupted();
}

// Where the driver has no second context, slow steps stop the window.
std::unique_ptr<StepThread> make_thread(GLFWwindow* window, const Capabilities& gl) {
  try {
    return std::make_unique<StepThread>(window, gl.software);
  } catch (const Error& error) {
    print_error(fmt::format("tetpbd: {}\n", error.what()));
    return nullptr;
  }
}

// Whatever ends the window, the thread has to leave the lanes first.
struct Leave {
  Session& session;
  ~Leave() {
    give_up_step(session);
    try {
      if (session.under_way) session.thread->wait(std::numeric_limits<double>::infinity());
    } catch (const std::exception&) {  // nobody is left to be told
    }
  }
};

}  // namespace

int run_window(const Scene& scene, const std::string& name, const SceneOverrides& overrides,
               const RunOptions& options) {
  const std::filesystem::path kept = cache_file("window.json");
  const Preferences before_now = read_preferences(kept);
  const RunOptions usual_options;
  const bool as_before = options.size == usual_options.size && before_now.width > 0;
  Desktop desktop(as_before ? before_now.width : options.size[0], as_before ? before_now.height : options.size[1],
                  "tetpbd");
  const Capabilities gl = load_gl();
  std::unique_ptr<StepThread> thread = make_thread(desktop.window, gl);
  Session s;  // after the desktop: its GL objects go before the context does
  const Leave leave{s};
  s.gl = gl;
  s.thread = thread.get();
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
  if (!options.lanes.empty()) compare_lanes(s, options.lanes), s.changes = {};

  View view;
  view.drawn = s.view;
  s.show_progress = [&](const std::string& what, double part) { show_progress(s, view, input, desktop, what, part); };
  bool vsync = !s.vsync, moving = false;  // moving: the camera
  std::string title;
  int last_width = 0, last_height = 0;
  long frames = 0;
  double before = glfwGetTime(), last_check = before, last_event = before;
  s.log("ready");
  if (s.hints_until > 0) s.hints_until += before;
  while (!glfwWindowShouldClose(desktop.window) && !s.quit && !interrupted()) {
    // With nothing moving, a few frames a second are enough and the processor can rest.
    const bool idle = !s.playing && !s.under_way && !is_filling(s) && !moving && !input.busy() && !s.task &&
                      !s.filming && view.read_back.pending() == 0 && glfwGetTime() - last_event > 0.5;
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
    attempt(s, [&] { begin_slow_step(s); });
    fill_map(s);
    moving = follow_bodies(s, elapsed);
    if (s.now - last_check > 0.5) {
      last_check = s.now;
      follow_shaders(s);
      keep();
    }
    draw_frame(s, view, input, desktop);
  }
  end_film(s, view);
  s.waiting.clear();
  if (s.record) attempt(s, [&] { finish_step(s); });  // its last line tells the state
  end_record(s);
  keep();
  s.log("closed");
  give_up_step(s);
  constexpr double most = 0.3;                                 // s that a window which has been closed may stay
  if (s.under_way && !thread->wait(most)) std::quick_exit(0);  // nothing is left to be written
  return 0;
}

}  // namespace tetpbd
