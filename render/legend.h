// Text and the colour scale over an image, in the window and headless alike.
#pragma once

#include <string>
#include <vector>

#include "render/handles.h"

namespace tetpbd {

/// What the scale says; `low` and `high` in `unit`.
struct LegendText {
  std::string title, unit;
  double low = 0, high = 1;
  bool is_signed = false;  ///< ticks carry a plus sign
};

struct Legend {
  struct Corner {
    glm::vec2 position;
    glm::vec3 coordinates;
    glm::vec4 colour;
  };
  struct Glyph {
    glm::vec2 low, high, uv_low, uv_high;
    float advance;
  };
  Program program;
  Texture glyphs;
  VertexArray corners_of;
  Buffer corners;
  std::vector<Glyph> font;  ///< characters 32..126 at their native size
  float line_height = 13;
};

/// Dear ImGui's built-in font (ProggyClean), without any ImGui context.
Legend make_legend();
/// The scale at the lower right, if any, and a caption at the upper left; uses the bound view block.
void draw_legend(Legend& legend, int width, int height, const LegendText* scale, const std::string& caption);

}  // namespace tetpbd
