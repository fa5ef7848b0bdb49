// The panels: what they show comes from a Session, what they change goes through its functions.
#pragma once

#include <imgui.h>

#include <string>
#include <vector>

#include "app/lab/chart.h"
#include "app/window/session.h"

namespace tetpbd {

/// The window, cut up: the panel at the right, timeline, plots and status line below, the view in what is
/// left.
struct Layout {
  Rect view, panel, timeline, plots, status;
};

/// A key and what it does: the help overlay and the keyboard read the same table.
struct Shortcut {
  int key;  ///< GLFW's code
  const char *shown, *help;
  void (*act)(Session&);
  int alternative = 0, modifiers = 0;
};
const std::vector<Shortcut>& shortcuts();

Layout make_layout(const Ui& ui, float width, float height);
/// All panels of a frame, between ImGui::NewFrame() and ImGui::Render().
void draw_ui(Session& session, const Layout& layout);
/// Over the view while the window stands still: "loading bunny-drop". With the part that is done it can be cancelled;
/// whether it is.
bool draw_busy(Session& session, const Layout& layout, const std::string& what, std::optional<double> part = {});

/// Sizes, font and colours for a display of this scale. `density`: framebuffer pixels a window coordinate.
void set_style(float scale, float density, bool dark = false);

/// A plot: of which history of each lane (none: frames per second), by powers of ten where that helps, over
/// time or over the time of a step.
struct PlotRow {
  const char *title, *unit;
  History Lane::*of;
  bool powers = false, over_cost = false;
};
const std::vector<PlotRow>& plot_rows();
/// Of all lanes, a line a value.
std::string plot_csv(const Session& session, const PlotRow& row);
Chart plot_chart(const Session& session, const PlotRow& row);
void draw_plots(Session& session, const Rect& place);
/// Begins a part of the window's layout, until ImGui::End().
void begin_part(const char* name, const Rect& place);

/// The panel at the right, and parts of it.
void draw_panel(Session& session);
void draw_scene(Session& session);
void draw_obstacles(Session& session);
void draw_map(Session& session);
void draw_file_button(Session& session, float width);
void draw_view(Session& session);
/// The bar below the view: speed, loop, what can be gone back to.
void draw_timeline(Session& session);

}  // namespace tetpbd
