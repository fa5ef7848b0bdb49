// Mouse and keyboard on the view: what a drag does is decided once the GPU has said what is under the cursor.
#pragma once

#include <functional>
#include <vector>

#include "app/ui.h"

struct GLFWwindow;

namespace tetpbd {

struct Input {
  Session& session;
  Ui& ui;
  Rect view{};
  /// `asking`: pressed, and the picker has not answered yet.
  enum class Drag { none, asking, grab, orbit, pan } drag = Drag::none;
  bool pinning = false;                              ///< the question is for a vertex to pin
  int button = -1;                                   ///< that holds the drag
  double x = 0, y = 0;                               ///< cursor, as far as events have been handled
  double last_press = -1, press_x = 0, press_y = 0;  ///< s, and where: for double clicks
  std::vector<std::function<void()>> events{};       ///< since the last frame, in order

  /// Something is under way that a frame must follow.
  bool busy() const { return drag != Drag::none || pinning || !events.empty(); }
};

/// Before Dear ImGui is started, which calls on what was installed. A queue of our own, since Dear ImGui
/// forgets what came and went within a frame, and frames of a software renderer are long.
void listen(GLFWwindow* window, Input& input);
/// After ImGui::NewFrame(), which knows whose the cursor and the keys are.
void handle_input(Input& input, const Rect& view);

}  // namespace tetpbd
