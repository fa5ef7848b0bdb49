// Mouse and keyboard: events wait in a queue until a frame has seen them, go to Dear ImGui, and where no widget wants
// them to the view. What a drag does there is decided once the GPU has said what is under the cursor.
#pragma once

#include <GL/glew.h>
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <array>
#include <cfloat>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "app/window/session.h"

namespace tetpbd {

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
  std::optional<int> axis{};                         ///< along which an obstacle is led, by its arrow
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

/// Takes all events of the window, for as long as that lives.
void listen(GLFWwindow* window, Input& input);
/// Before ImGui::NewFrame(): as many of the events that wait as one frame can tell apart.
void feed(Input& input, GLFWwindow* window);
/// After ImGui::NewFrame(), which knows whose the cursor and the keys are.
void handle_input(Input& input, const Rect& view);

}  // namespace tetpbd
