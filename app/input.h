// Mouse and keyboard on the view: what a drag does is decided once the GPU has said what is under the cursor.
#pragma once

#include <vector>

#include "app/ui.h"

namespace tetpbd {

/// Something that happened since the last frame, in order; x, y in window coordinates.
struct Event {
  enum class Kind { key, press, release, move, wheel } kind;
  int code = 0, modifiers = 0;  ///< key or button
  double x = 0, y = 0;          ///< of the cursor; wheel: how far it turned
};

struct Mouse {
  /// `asking`: pressed, and the picker has not answered yet.
  enum class Drag { none, asking, grab, orbit, pan } drag = Drag::none;
  bool pinning = false;                              ///< the question is for a vertex to pin
  int button = -1;                                   ///< that holds the drag
  double x = 0, y = 0;                               ///< cursor, as far as events have been handled
  double last_press = -1, press_x = 0, press_y = 0;  ///< s, and where: for double clicks
  std::vector<Event> events;
};

/// After ImGui::NewFrame(), which knows whose the cursor and the keys are.
void handle_input(Session& session, Ui& ui, Mouse& mouse, const Rect& view);
/// Something is under way that a frame must follow.
bool is_busy(const Mouse& mouse);

}  // namespace tetpbd
