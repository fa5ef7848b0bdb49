// Widgets of the panel: a label, the widget and what it means. One that is not as usual is marked, and a
// right click takes it back.
#pragma once

#include <imgui.h>

#include <optional>
#include <string>
#include <vector>

#include "app/window/session.h"

namespace tetpbd {

using Words = std::vector<std::string>;

/// The part of a line that labels take.
float label_width();
std::string label_of(const char* parameter);
/// Notes where the last widget is, so that a test can find it: "at NAME x y width height".
void mark(Session& session, const std::string& name);
void mark(Session& session, const std::string& name, const Rect& place);
/// For text of errors, and of what is worth a look, on the theme's ground.
ImVec4 alarm(const Session&session), accent(const Session&session);

/// After a widget: marks it, and says what it means while the cursor is over it. `back`: what a right click
/// goes back to; none where it is as usual. Whether it is to go back.
bool describe_item(Session& session, const std::string& name, const std::string& help, const std::string& back = {});
/// A line: its label, then the widget of the id that this gives, then what it means.
std::string begin_row(Session& session, const std::string& label, bool unusual = false);
bool end_row(Session& session, const std::string& name, const std::string& help, const std::string& back = {});

/// Part of the panel that can be folded, and stays so; `open`: at first.
bool section(Session& session, const char* name, bool open = true);
/// The rest of a section.
bool more(Session& session, const std::string& section, bool unusual);

/// A slider for a number (double or int), or where `speed` is above 0 a field that is dragged by that a pixel. What is
/// typed into it counts from Enter on, or once the focus is elsewhere; beyond the range it is brought back, and said.
template <class T>
bool edit_number(Session& session, const std::string& id, const std::string& name, T& value, T low, T high,
                 const std::string& format, bool logarithmic, float speed = 0);

bool button(Session& session, const char* label, const char* name, const char* help, float width = 0);
/// Whether it changed.
bool check_box(Session& session, const char* label, bool& value, const std::string& help,
               std::optional<bool> usual = {});
bool slider(Session& session, const char* label, double& value, double usual, double low, double high,
            const char* format, const char* help, bool logarithmic = false);
/// The word chosen, once.
std::optional<std::string> combo(Session& session, const std::string& label, const std::string& now, const Words& words,
                                 const std::string& help, const std::string& usual = {});
/// For an enumeration whose names are in its order.
template <class Enum, class Names>
void enum_combo(Session& s, const char* label, const Names& names, Enum& value, Enum usual, const std::string& help) {
  const auto chosen = combo(s, label, names[std::size_t(value)], Words(std::begin(names), std::end(names)), help,
                            names[std::size_t(usual)]);
  if (!chosen) return;
  value = Enum(std::ranges::find(names, *chosen) - std::begin(names));
  s.log("{} {}", label, *chosen);
}

}  // namespace tetpbd
