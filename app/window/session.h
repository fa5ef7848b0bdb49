// What the window shows and what can be done to it, without any widget.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <deque>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/lab/auto_solver.h"
#include "app/lab/live_map.h"
#include "app/scene.h"
#include "app/window/grab.h"
#include "app/window/lanes.h"
#include "app/window/preferences.h"
#include "app/window/probe.h"
#include "app/window/record.h"
#include "app/window/step_thread.h"
#include "app/window/timeline.h"
#include "render/picking.h"
#include "render/renderer.h"
#include "render/target.h"
#include "sim/measure/metrics.h"
#include "sim/sim.h"

namespace tetpbd {

/// A scene with all that is made from it; replaced as a whole: one that fails to load changes nothing.
struct Loaded {
  std::string name;  ///< as it was asked for
  SceneOverrides overrides;
  Scene scene;
  Settings own{};                        ///< of the scene as it was asked for: what a setting goes back to
  std::shared_ptr<const Model> model{};  ///< of all lanes
  std::vector<Lane> lanes;               ///< one, or several side by side
  Renderer renderer;
  Picker picker;
  std::optional<SolverChoice> choice{};  ///< made last, by --solver auto or in the window
  std::size_t chosen = 0;                ///< the lane that the panel is of
  std::vector<bool> hidden{};            ///< by body, as the view leaves them out
  std::optional<std::size_t> body{};     ///< whose material, friction and restitution it shows; none: of all
  std::optional<Motion> right{};         ///< where it is known, of several lanes or for its colours
  bool comparable = true;                ///< lanes differ in how they are solved alone
  bool disturbed = false;                ///< they are no longer held against it, until they start anew
  Buffer answers{};                      ///< where the reference motion has the vertices
  long held = -1;                        ///< step at which vertices were last held against it
  Probe probe{};
  FlattestTet flattest{};  ///< at rest
  std::optional<LiveMap> map{};
  Lane& lane() { return lanes[chosen]; }
  const Lane& lane() const { return lanes[chosen]; }
  Sim& sim() { return lane().sim; }
  const Sim& sim() const { return lanes[chosen].sim; }
};
Loaded load(const std::string& name, const SceneOverrides& overrides, Scene scene);

struct Message {
  std::string text;
  bool error = false;
  bool non_finite = false;  ///< stays until a reset, a way back or another scene mends the state
  double since = 0;         ///< s
};

/// A line for each event, in the file that TETPBD_WINDOW_LOG names, for tests and demonstrations.
struct EventLog {
  std::ofstream file;
  template <class... T>
  void operator()(fmt::format_string<T...> text, T&&... values) {
    if (file.is_open()) file << fmt::format(text, std::forward<T>(values)...) << std::endl;
  }
};

/// Simulated against real time.
struct Clock {
  bool fast = false;               ///< as fast as possible instead of real time
  int halvings = 0;                ///< of the speed: slow motion
  double owed = 0;                 ///< s of real time, so slowed down, not yet simulated
  int most_steps = 4;              ///< a frame; follows what the GPU can do
  double real = 0, simulated = 0;  ///< s, since the factor was last worked out
  int frames = 0;                  ///< since factor was found
  double waited = 0;               ///< s of the last frame, for a step under way
  double factor = 0;               ///< simulated seconds a real one
  double speed() const { return std::ldexp(1.0, -halvings); }
};

/// Something that stops the window for a while: done once its name has been on the screen.
struct Task {
  std::string name;
  std::function<void()> act;
};

/// Window coordinates, from the top left.
struct Rect {
  float x = 0, y = 0, width = 0, height = 0;
  bool contains(double px, double py) const {
    return px >= double(x) && py >= double(y) && px < double(x + width) && py < double(y + height);
  }
  bool operator==(const Rect&) const = default;
};

/// What of a plot's axis is seen.
struct PlotView {
  bool zoomed = false;
  double low = 0, high = 1;
};

/// The axes of the map, as they are typed.
struct MapWords {
  std::string x{}, y{};
  bool typed = false;
};

/// What the list of scenes shows of one.
struct SceneCard {
  std::string description{};
  Texture picture{};
};
inline constexpr int picture_width = 192, picture_height = 144;  // pixels

/// A folder as it was when it was entered.
struct FileList {
  struct Entry {
    std::string name;
    bool folder;
  };
  std::filesystem::path folder{};
  std::vector<Entry> entries{};
};

/// What is shown of the panels.
struct Ui {
  bool panels = true, plots = true, help = false;
  float scale = 1;  ///< of the display, 2 on a dense one, times that of the text
  Preferences kept;
  bool rebudget = false;  ///< once the slider is let go
  /// The widget into which a number is being typed, and what it says so far.
  std::optional<std::pair<unsigned, double>> typed{};
  std::array<bool, 3> hinted{};            ///< of hint_texts, those that were followed
  std::map<std::string, SceneCard> cards;  ///< by file, once shown
  MapWords map;
  bool at_flattest = false;  ///< the cursor is on what the panel says of the flattest tet
  std::string mesh;          ///< path being typed
  FileList files;
  std::map<std::string, Rect> places;  ///< of widgets, as last logged
  std::array<PlotView, 3> plot_views;
  std::array<std::array<std::size_t, 3>, 2> plot_choice{
      {{0, 1, 2}, {1, 4, 5}}};  ///< plot_rows(): of one lane, of several
};

inline constexpr double usual_grab_radius = 0.04;

/// What is done once the step under way has ended. An action is also seen in the panel until then.
struct Waiting {
  std::function<void()> act;
  std::optional<Action> action{};
};

struct Session {
  Capabilities gl;
  EventLog log;
  Ui ui;
  Loaded loaded;
  Camera camera;
  ViewOptions view, first_view;  ///< of now, and as the window began
  int samples = 4, first_samples = 4;
  float aspect = 1;  ///< of the viewport
  bool playing = true, vsync = true;
  bool take_screenshot = false, filming = false, quit = false;
  double hints_until = 0;        ///< s, of `now`
  StepThread* thread = nullptr;  ///< takes the steps that are slow; none: all are taken at once
  /// A step that the thread takes. Until it has ended, lanes are seen as they were.
  struct UnderWay {
    std::vector<Lane*> lanes{};
    std::vector<double> seconds{};  ///< of each
    bool whole = false;             ///< else somebody gave it up
  };
  std::unique_ptr<UnderWay> under_way{};
  std::deque<Waiting> waiting{};  ///< for its end, in order
  double step_seconds = 0;        ///< that the last step took, as far as is known
  Clock clock;
  Timeline timeline;
  std::unique_ptr<Record> record{};        ///< if anybody wants it
  std::optional<Hold> hold;                ///< what is led by the mouse, or by a record
  std::optional<Grab> grab;                ///< by the mouse
  double grab_radius = usual_grab_radius;  ///< part of the size
  Changes changes;
  int obstacle = -1;             ///< of the scene's, the chosen one; -1: none
  bool moving_obstacle = false;  ///< by the mouse
  std::vector<Message> messages;
  std::optional<Task> task;
  /// Draws how far a task is, now and then; throws Interrupted once somebody cancels it. None without a window.
  SolverProgress show_progress{};
  double budget_ms = 0.5;           ///< for the solver auto
  bool measuring = true;            ///< somebody looks at the measurements
  std::optional<glm::vec3> centre;  ///< of the bodies' bounds, a frame or more ago
  glm::vec3 beside{0};              ///< from there to what a following camera looks at, by moving the view
  History frames_per_second;
  bool probing = true;                                 ///< the cursor at rest on a body says what is there
  bool fit_range = false;                              ///< of the colours, once to the values of now
  double fitted = -1;                                  ///< when they were last
  std::vector<std::pair<std::uint32_t, float>> worst;  ///< vertices and their values, the largest first
  bool overlaid = false;                               ///< lanes are drawn in one place
  bool ghost = true;                                   ///< beside the others stands the one they are held against
  double now = 0;                                      ///< s since the start
};

void say(Session& session, const std::string& text, bool error = false, bool non_finite = false);
/// What went wrong before, once something went well or is tried anew; not of shaders and states, as long as
/// they are not mended.
void forget_errors(Session& session);
/// Does it; what it throws becomes a message, but for ContextLost. Whether it went well.
bool attempt(Session& session, const std::function<void()>& action);

void take_over(Session& session, Loaded loaded, bool keep_camera);
/// After the state was put back: what was measured, or is under way to be, belongs to what was before.
void start_afresh(Session& session);
/// The motion is no longer that of the scene: somebody had a hand in it, or it is over.
void disturb(Session& session);
/// The reference motion of all lanes, where there is one; looked for where it may be another than before.
void find_right(Session& session);
/// What lanes are held against now, where the reference motion is known.
const Motion* right_now(const Session& session);
/// How far each vertex is from it, if somebody looks at that.
void hold_vertices(Session& session);
/// What the automatic solver chose.
void say_choice(Session& session);
/// The state of now, into a file in the current folder.
void save_state_file(Session& session);
/// The scene with the settings and the camera of now, into a file of its own, with a picture beside it.
void save_scene(Session& session);
/// Finds what it needs, or says what is missing.
void choose_colour(Session& session, Colour colour);
/// Whether there is something to colour by.
bool has_colour(const Session& session, Colour colour);
/// The vertices with the largest values of the colour, apart from each other, once values have arrived.
void find_worst(Session& session);
/// Compiles again what changed in the shader folder.
void follow_shaders(Session& session);

// ------------------------------------------------------------------------------------------------------------
// what a user asks for, as actions (requests.cpp)

inline constexpr int most_halvings = 5;
void change_speed(Session& session, int halvings);
int halvings_for(double speed);
/// To the start; with a parameter changed that needs it, the bodies are made again.
void restart(Session& session);
/// To the last good state, once the state is not finite.
void go_back(Session& session);
/// Those of the chosen lane. Refuses what would make steps that stop the window for minutes.
void change_settings(Session& session, const Settings& wanted);
/// For the panel; none: all.
void choose_body(Session& session, std::optional<std::size_t> body);
/// The one under the mouse, or, beside the bodies, all.
void choose_body_at_cursor(Session& session);
/// One more, with the settings of the chosen lane and `words` in their place (lane_settings); all start anew.
void add_lane(Session& session, const std::string& words = {});
/// The last that is left stays.
void remove_lane(Session& session, std::size_t lane);
void choose_lane(Session& session, std::size_t lane);
/// In place of all lanes; the first keeps the scene's settings where there is no word for it.
void compare_lanes(Session& session, const std::vector<std::string>& words);
void toggle_pin(Session& session, std::uint32_t vertex);
void catch_vertex(Session& session, const Pick& pick);
/// What is held, if anything.
void let_go(Session& session);
/// Makes it the task to choose a solver within the budget; the bodies stay where they are.
void choose_soon(Session& session);
/// Makes it the task to load a scene; where that fails all stays. `keep`: settings, lanes and obstacles.
void load_soon(Session& session, const std::string& name, const SceneOverrides& overrides, bool keep, bool keep_camera);
/// What was dropped, typed or opened before: a state, a scene, or a mesh for this scene's first body.
void open_file(Session& session, const std::filesystem::path& file);

// ------------------------------------------------------------------------------------------------------------
// steps (stepping.cpp)

void play(Session& session, bool playing);
void single_step(Session& session);
/// All lanes; throws what a step throws.
void step_lanes(Session& session);
/// Lets the thread take the next step, if the session plays and steps are slow.
void begin_slow_step(Session& session);
/// Waits for the step under way and does what waits for its end. Throws what the step throws.
void finish_step(Session& session);
/// Ends it as soon as may be, because all starts anew.
void give_up_step(Session& session);
/// Does it at once, or where a step is under way, when that has ended: nothing else may change a lane or read what a
/// step changes of it.
void between_steps(Session& session, std::function<void()> act);
/// The settings of a lane and the obstacles, as they will be when nothing waits any more.
const Settings& asked_settings(const Session& session, std::size_t lane);
const Settings& asked_settings(const Session& session);
const std::vector<Obstacle>& asked_obstacles(const Session& session);
/// For tests: a run of as many steps must give the same. Waits for the GPU.
void log_state(Session& session);
/// Pauses and says so when the state is found not to be finite.
void watch_state(Session& session);
/// A way to come nearer to real time, and its words (lane_settings), if it is one of settings.
struct Advice {
  std::string said, words;
  std::function<void(Session&)> act{};  ///< in place of words; none and no words: said alone
};
/// Where steps take more than twice the time that they simulate.
std::optional<Advice> faster_way(const Session& session);
/// Steps as many times as `elapsed` seconds ask for and the machine allows.
void advance(Session& session, double elapsed);
/// Takes in measurements and timings that have arrived, and asks for the next.
void measure_frame(Session& session, bool stepped);
/// Goes on with the map, if there is one that is not done.
void fill_map(Session& session);
bool is_filling(const Session& session);

// ------------------------------------------------------------------------------------------------------------
// the view (view.cpp)

void frame_body(Session& session);
void keep_above_ground(Session& session);
/// By a part of the bodies' extent.
void move_cut(Session& session, double by);
/// None, along x, y, z, facing the eye.
void next_cut(Session& session);
/// Where a lane is drawn: pixels, from the lower left.
Viewport tile_in(const Session& session, std::size_t lane, int width, int height);
/// The same within a view, in window coordinates.
Rect lane_place(const Session& session, std::size_t lane, const Rect& view);
/// Where a point is seen in such a place, in window coordinates.
glm::vec2 seen_at(const Session& session, const Rect& place, const glm::dvec3& point);
/// What is to be picked of a lane: as it is drawn, but for size and marks.
Frame shown_frame(const Session& session, std::size_t lane);
/// All of them, and the ghost of the one that others are held against.
void draw_lanes(Session& session, const Target& target);
/// From the view, or back into it; it is solved all the same.
void hide_body(Session& session, std::size_t body, bool hidden);
/// Hides the body under the mouse, or, beside the bodies, shows all again.
void hide_or_show(Session& session);
/// Leads the camera after the bodies; whether it is still on its way.
bool follow_bodies(Session& session, double elapsed);

}  // namespace tetpbd
