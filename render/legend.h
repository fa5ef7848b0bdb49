// Text and the colour scale over an image, in the window and headless alike, drawn by Dear ImGui.
#pragma once

#include <memory>
#include <string>

#include "render/frame.h"

struct ImFontAtlas;
struct ImGuiContext;

namespace tetpbd {

/// DejaVu Sans, which travels inside the program, in place of what fonts there are; `size` in pixels.
void set_font(ImFontAtlas& atlas, float size);

/// A context of Dear ImGui beside the window's. Contexts are current for the whole program: one thread draws.
struct Legend {
  struct Close {
    void operator()(ImGuiContext* context) const;
  };
  std::unique_ptr<ImGuiContext, Close> context;
  float font_size = 0;
};
Legend make_legend();
/// A colour scale at the lower right where the options ask for one, a caption at the upper left.
void draw_legend(Legend& legend, const Viewport& viewport, const ViewOptions& options,
                 const std::string& caption);

/// The range that the options' colour shows.
ColourRange colour_range(const ViewOptions& options);
inline bool has_scale(const ViewOptions& options) {
  return options.legend && options.colour != Colour::plain;
}

}  // namespace tetpbd
