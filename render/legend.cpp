#include "render/legend.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "render/layout.h"

namespace tetpbd {

namespace {

enum Kind { glyph = 0, plain = 1, bar = 2, panel = 3 };

using Corners = std::vector<Legend::Corner>;
const glm::vec4 ink{0.030f, 0.034f, 0.040f, 1.0f};

void add_rectangle(Corners& corners, glm::vec2 low, glm::vec2 high, glm::vec2 uv_low, glm::vec2 uv_high,
                   Kind kind, const glm::vec4& colour) {
  const auto corner = [&](bool x, bool y) {
    return Legend::Corner{{x ? high.x : low.x, y ? high.y : low.y},
                          {x ? uv_high.x : uv_low.x, y ? uv_high.y : uv_low.y, float(kind)},
                          colour};
  };
  for (auto [x, y] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}})
    corners.push_back(corner(x, y));
}

float text_width(const Legend& legend, const std::string& text, float scale) {
  float width = 0;
  for (char c : text)
    if (c >= 32 && c < 127) width += legend.font[std::size_t(c - 32)].advance * scale;
  return width;
}

void add_text(Corners& corners, const Legend& legend, glm::vec2 at, const std::string& text, float scale,
              const glm::vec4& colour) {
  at = glm::round(at);  // the font is a bitmap: between pixels it blurs
  for (char c : text) {
    if (c < 32 || c >= 127) continue;
    const Legend::Glyph& g = legend.font[std::size_t(c - 32)];
    add_rectangle(corners, at + g.low * scale, at + g.high * scale, g.uv_low, g.uv_high, glyph, colour);
    at.x += g.advance * scale;
  }
}

}  // namespace

Legend make_legend() {
  Legend legend;
  legend.program = Program(
      "legend", {{GL_VERTEX_SHADER, "render/legend.vert"}, {GL_FRAGMENT_SHADER, "render/legend.frag"}});
  ImFontAtlas atlas;
  const ImFont* font = atlas.AddFontDefault();
  unsigned char* pixels = nullptr;
  int width = 0, height = 0;
  atlas.GetTexDataAsAlpha8(&pixels, &width, &height);
  legend.glyphs = Texture::make("glyphs");
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_R8, width, height, 0, GL_RED, GL_UNSIGNED_BYTE, pixels);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  for (GLenum name : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTexParameteri(GL_TEXTURE_2D, name, GL_NEAREST);
  legend.line_height = font->FontSize;
  for (int c = 32; c < 127; ++c) {
    const ImFontGlyph* g = font->FindGlyph(ImWchar(c));
    legend.font.push_back({{g->X0, g->Y0}, {g->X1, g->Y1}, {g->U0, g->V0}, {g->U1, g->V1}, g->AdvanceX});
  }
  legend.corners_of = VertexArray::make("legend");
  return legend;
}

void draw_legend(Legend& legend, int width, int height, const LegendText* scale, const std::string& caption) {
  const float zoom = float(std::max(1, int(std::lround(double(height) / 900.0))));
  const float line = legend.line_height * zoom, pad = 10 * zoom, margin = 18 * zoom;
  Corners corners;
  glm::vec4 box{0.0f};
  if (scale) {
    const int ticks = 5;
    std::vector<std::string> labels;
    float label_width = 0;
    for (int i = 0; i < ticks; ++i) {
      double value = scale->low + (scale->high - scale->low) * i / (ticks - 1);
      if (std::abs(value) < 1e-9 * (scale->high - scale->low)) value = 0;
      labels.push_back(scale->is_signed && value != 0 ? fmt::format("{:+.3g}", value)
                                                      : fmt::format("{:.3g}", value));
      label_width = std::max(label_width, text_width(legend, labels.back(), zoom));
    }
    const std::string heading = scale->title, unit = scale->unit;
    const float bar_width = 14 * zoom,
                bar_height = std::round(std::min(190.0f * zoom, 0.42f * float(height)));
    const float inner = std::max({text_width(legend, heading, zoom), text_width(legend, unit, zoom),
                                  bar_width + 10 * zoom + label_width});
    const glm::vec2 size{inner + 2 * pad, bar_height + 2 * line + 3 * pad};
    const glm::vec2 low{float(width) - margin - size.x, float(height) - margin - size.y}, high = low + size;
    box = glm::vec4((low + high) * 0.5f, size * 0.5f);
    add_rectangle(corners, low, high, glm::vec2(0.0f), glm::vec2(0.0f), panel, {0.95f, 0.95f, 0.95f, 0.72f});
    add_text(corners, legend, low + glm::vec2(pad), heading, zoom, ink);
    add_text(corners, legend, low + glm::vec2(pad, pad + line), unit, zoom,
             glm::vec4(0.13f, 0.14f, 0.15f, 1.0f));
    const glm::vec2 top = glm::round(low + glm::vec2(pad, 2 * pad + 2 * line - line * 0.25f));
    add_rectangle(corners, top, top + glm::vec2(bar_width, bar_height), {0.0f, 1.0f}, {0.0f, 0.0f}, bar,
                  glm::vec4(1.0f));
    for (int i = 0; i < ticks; ++i) {
      const float y =
          std::round(top.y + bar_height * (1.0f - float(i) / float(ticks - 1)) - (i == 0 ? zoom : 0));
      const glm::vec2 tick{top.x + bar_width, y};
      add_rectangle(corners, tick, tick + glm::vec2(4 * zoom, zoom), glm::vec2(0.0f), glm::vec2(0.0f), plain,
                    ink);
      add_text(corners, legend, {tick.x + 10 * zoom, y - line * 0.5f + zoom}, labels[std::size_t(i)], zoom,
               ink);
    }
  }
  add_text(corners, legend, glm::vec2(margin), caption, zoom, ink);
  if (corners.empty()) return;

  const std::size_t bytes = corners.size() * sizeof(Legend::Corner);
  glBindVertexArray(legend.corners_of.id());
  if (legend.corners.bytes() < bytes) {
    legend.corners = Buffer("legend corners", 2 * bytes, nullptr, GL_STREAM_DRAW);
    glBindBuffer(GL_ARRAY_BUFFER, legend.corners.id());
    const auto attribute = [](GLuint index, GLint count, std::size_t offset) {
      glEnableVertexAttribArray(index);
      glVertexAttribPointer(index, count, GL_FLOAT, GL_FALSE, sizeof(Legend::Corner),
                            reinterpret_cast<const void*>(offset));
    };
    attribute(0, 2, offsetof(Legend::Corner, position));
    attribute(1, 3, offsetof(Legend::Corner, coordinates));
    attribute(2, 4, offsetof(Legend::Corner, colour));
  }
  legend.corners.write(0, bytes, corners.data());
  legend.program.use();
  legend.program.set("panel", box);
  glActiveTexture(GL_TEXTURE0 + UNIT_GLYPHS);
  glBindTexture(GL_TEXTURE_2D, legend.glyphs.id());
  glActiveTexture(GL_TEXTURE0);
  glDrawArrays(GL_TRIANGLES, 0, GLsizei(corners.size()));
}

}  // namespace tetpbd
