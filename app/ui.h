// The panels: what they show comes from a Session, what they change goes through its functions.
#pragma once

#include <imgui.h>

#include <map>
#include <string>
#include <vector>

#include "app/session.h"

namespace tetpbd {

/// Window coordinates, from the top left.
struct Rect {
  float x = 0, y = 0, width = 0, height = 0;
  bool contains(double px, double py) const {
    return px >= double(x) && py >= double(y) && px < double(x + width) && py < double(y + height);
  }
  bool operator==(const Rect&) const = default;
};

/// The window, cut up: the panel at the right, plots and status line below, the view in what is left.
struct Layout {
  Rect view, panel, plots, status;
};

struct Ui {
  bool panels = true, plots = true, help = false;
  float scale = 1;                     ///< of the display: 2 on a dense one
  std::string mesh;                    ///< path being typed
  std::map<std::string, Rect> places;  ///< of widgets, as last logged
};

/// A key and what it does: the help overlay and the keyboard read the same table.
struct Shortcut {
  int key;  ///< GLFW's code
  const char *shown, *help;
  void (*act)(Session&, Ui&);
  int alternative = 0, modifiers = 0;
};
const std::vector<Shortcut>& shortcuts();

Layout make_layout(const Ui& ui, float width, float height);
/// All panels of a frame, between ImGui::NewFrame() and ImGui::Render().
void draw_ui(Session& session, Ui& ui, const Layout& layout);
/// Over the view while the window stands still: "loading bunny-drop".
void draw_busy(const Layout& layout, const std::string& what);

/// Sizes and font for a display of this scale. `density`: framebuffer pixels a window coordinate.
void set_style(float scale, float density);

/// The panel at the right, and the part of its width that a widget's label takes.
void draw_panel(Session& session, Ui& ui);
float label_width();
std::string label_of(const char* parameter);
/// Notes where the last widget is, so that a test can find it: "at NAME x y width height".
void mark(Session& session, Ui& ui, const std::string& name);
void mark(Session& session, Ui& ui, const std::string& name, const Rect& place);

}  // namespace tetpbd
