#include "render/legend.h"

#include <backends/imgui_impl_opengl3.h>
#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/color_space.hpp>

extern "C" const unsigned char _binary_font_ttf_start[], _binary_font_ttf_end[];

namespace tetpbd {

namespace {

namespace colour_maps {
using glm::clamp, glm::mix, glm::vec3, std::abs, std::cos, std::sin;
#include "shaders/render/colour.glsl"
}  // namespace colour_maps

constexpr ImU32 ink = IM_COL32(48, 51, 56, 255), paper = IM_COL32(249, 249, 249, 184);

// Makes a context the current one until the end of a scope.
struct Current {
  ImGuiContext* before = ImGui::GetCurrentContext();
  explicit Current(ImGuiContext* context) { ImGui::SetCurrentContext(context); }
  ~Current() { ImGui::SetCurrentContext(before); }
};

ImU32 scale_colour(const ViewOptions& options, double value) {
  const ColourRange& range = options.range();
  const glm::vec3 c = glm::convertLinearToSRGB(
      colour_maps::scale_colour(int(options.colour), float(value), float(range.low), float(range.high)));
  return ImGui::ColorConvertFloat4ToU32({c.x, c.y, c.z, 1});
}

void draw_scale(ImDrawList& draw, const ViewOptions& options, ImVec2 corner, float height, float line) {
  const auto [title, unit, factor, start, most, is_signed] = options.scale();
  constexpr int ticks = 5;
  const float pad = 0.75f * line, bar_height = std::round(std::min(14.5f * line, 0.42f * height));
  const auto value = [&, range = options.range()](float part) {
    return range.low + (range.high - range.low) * double(part);
  };
  std::string labels[ticks];
  float width = std::max(ImGui::CalcTextSize(title).x, ImGui::CalcTextSize(unit).x);
  for (int i = 0; i < ticks; ++i) {
    const double shown = value(float(i) / (ticks - 1)) * factor;
    labels[i] = std::abs(shown) < 1e-9 ? "0" : fmt::format(fmt::runtime(is_signed ? "{:+.3g}" : "{:.3g}"), shown);
    width = std::max(width, line + pad + ImGui::CalcTextSize(labels[i].c_str()).x);
  }
  const ImVec2 low(std::round(corner.x - width - 2 * pad),
                   std::round(corner.y - bar_height - 2.25f * line - 2.5f * pad));
  draw.AddRectFilled(low, corner, paper, 0.6f * line);
  draw.AddText(ImVec2(low.x + pad, low.y + pad), ink, title);
  draw.AddText(ImVec2(low.x + pad, low.y + pad + line), ink, unit);
  const ImVec2 bar(std::round(low.x + pad), std::round(corner.y - 1.25f * pad - bar_height));
  for (float y = 0; y < bar_height; ++y)
    draw.AddRectFilled(ImVec2(bar.x, bar.y + y), ImVec2(bar.x + line, bar.y + y + 1),
                       scale_colour(options, value(1 - y / (bar_height - 1))));
  for (int i = 0; i < ticks; ++i) {
    const ImVec2 tick(bar.x + line, std::round(bar.y + (bar_height - 1) * (1 - float(i) / (ticks - 1))));
    draw.AddRectFilled(tick, ImVec2(tick.x + 0.3f * line, tick.y + 1), ink);
    draw.AddText(ImVec2(tick.x + pad, std::round(tick.y - line / 2)), ink, labels[i].c_str());
  }
}

}  // namespace

void set_font(ImFontAtlas& atlas, float size) {
  atlas.Clear();
  ImFontConfig config;
  config.FontDataOwnedByAtlas = false;
  // The atlas only reads the font, but its parameter is not const.
  atlas.AddFontFromMemoryTTF(const_cast<unsigned char*>(_binary_font_ttf_start),
                             int(_binary_font_ttf_end - _binary_font_ttf_start), size, &config);
}

ColourRange fitted_range(const ColourScale& scale, std::vector<float> values) {
  std::erase_if(values, [](float value) { return !std::isfinite(value); });
  if (values.empty()) return scale.range;
  for (float& value : values) value = std::abs(value);
  const auto largest = values.begin() + std::ptrdiff_t(values.size() * 95 / 100);
  std::ranges::nth_element(values, largest);
  const double least = std::max(double(*largest), 1e-3 * scale.range.high) * scale.factor * (1 - 1e-6);
  const double power = std::pow(10, std::floor(std::log10(least)));
  double high = 10 * power;
  for (const double step : {5.0, 2.0, 1.0})
    if (least <= step * power) high = step * power;
  high /= scale.factor;
  return {scale.is_signed ? -high : 0, high};
}

void CloseLegend::operator()(ImGuiContext* context) const {
  {
    const Current current(context);
    ImGui_ImplOpenGL3_Shutdown();
  }
  ImGui::DestroyContext(context);
}

void draw_legend(Legend& legend, const Viewport& viewport, const ViewOptions& options, const std::string& caption) {
  const Current current(legend.get());
  if (!legend) {
    legend.reset(ImGui::CreateContext());
    ImGui::SetCurrentContext(legend.get());
    ImGui::GetIO().IniFilename = nullptr;
    ImGui_ImplOpenGL3_Init("#version 430 core");
  }
  ImGuiIO& io = ImGui::GetIO();
  const float line = std::round(13.0f * std::max(1.0f, float(viewport.height) / 720.0f));
  const float margin = 1.4f * line;
  if (io.Fonts->Fonts.empty() || io.Fonts->Fonts[0]->FontSize != line) {
    set_font(*io.Fonts, line);
    ImGui_ImplOpenGL3_DestroyFontsTexture();
    ImGui_ImplOpenGL3_CreateFontsTexture();
  }
  // Dear ImGui's viewport begins at the framebuffer's lower left, and its y runs down from the top.
  const ImVec2 low(float(viewport.x), 0), high(low.x + float(viewport.width), float(viewport.height));
  io.DisplaySize = ImVec2(high.x, high.y + float(viewport.y));
  ImGui_ImplOpenGL3_NewFrame();
  ImGui::NewFrame();
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  if (options.has_scale())
    draw_scale(draw, options, ImVec2(high.x - margin, high.y - margin), float(viewport.height), line);
  draw.AddText(ImVec2(low.x + std::round(margin), std::round(margin)), ink, caption.c_str());
  ImGui::Render();
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
}

}  // namespace tetpbd
