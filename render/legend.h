// Draws text and the colour scale over an image with Dear ImGui, in the window and headless alike.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render/frame.h"

struct ImFontAtlas;
struct ImGuiContext;

namespace tetpbd {

/// Replaces all fonts of the atlas by DejaVu Sans, which is part of the program; `size` in pixels.
void set_font(ImFontAtlas& atlas, float size);

/// A range that shows all but the largest twentieth of the values. It ends at 1, 2 or 5 times a power of ten of the
/// unit, and at no less than a thousandth of the scale's initial end, below which is noise.
ColourRange fitted_range(const ColourScale& scale, std::vector<float> values);

struct CloseLegend {
  void operator()(ImGuiContext* context) const;
};
/// A context of Dear ImGui beside the window's. As the current context is the whole program's, only one thread draws.
using Legend = std::unique_ptr<ImGuiContext, CloseLegend>;
/// Draws a colour scale at the lower right if the options ask for one, and a caption at the upper left.
void draw_legend(Legend& legend, const Viewport& viewport, const ViewOptions& options, const std::string& caption);

}  // namespace tetpbd
