// Text and the colour scale over an image, in the window and headless alike, drawn by Dear ImGui.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render/frame.h"

struct ImFontAtlas;
struct ImGuiContext;

namespace tetpbd {

/// DejaVu Sans, which travels inside the program, in place of what fonts there are; `size` in pixels.
void set_font(ImFontAtlas& atlas, float size);

/// What shows all but the largest twentieth of the values: 1, 2 or 5 times a power of ten of the unit, and no
/// less than a thousandth of the scale's first, which would be noise.
ColourRange fitted_range(const ColourScale& scale, std::vector<float> values);

struct CloseLegend {
  void operator()(ImGuiContext* context) const;
};
/// A context of Dear ImGui beside the window's. Contexts are current for the whole program: one thread draws.
using Legend = std::unique_ptr<ImGuiContext, CloseLegend>;
/// A colour scale at the lower right where the options ask for one, a caption at the upper left.
void draw_legend(Legend& legend, const Viewport& viewport, const ViewOptions& options, const std::string& caption);

}  // namespace tetpbd
