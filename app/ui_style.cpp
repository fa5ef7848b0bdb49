#include <array>
#include <filesystem>

#include "app/ui.h"

namespace tetpbd {

namespace {

// A system font reads better than the bitmap font that ImGui carries; without one of these that is used.
constexpr std::array fonts{
    "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
    "/usr/share/fonts/TTF/DejaVuSans.ttf", "/usr/share/fonts/truetype/liberation2/LiberationSans-Regular.ttf",
    "/usr/share/fonts/truetype/noto/NotoSans-Regular.ttf"};

void set_colours(ImVec4* c) {
  const ImVec4 accent(0.18f, 0.42f, 0.60f, 1.0f);
  const auto tint = [&](float alpha) { return ImVec4(accent.x, accent.y, accent.z, alpha); };
  c[ImGuiCol_Text] = ImVec4(0.13f, 0.15f, 0.18f, 1);
  c[ImGuiCol_TextDisabled] = ImVec4(0.48f, 0.51f, 0.55f, 1);
  c[ImGuiCol_WindowBg] = ImVec4(0.965f, 0.968f, 0.973f, 1);
  c[ImGuiCol_PopupBg] = ImVec4(0.985f, 0.987f, 0.990f, 1);
  c[ImGuiCol_Border] = ImVec4(0.80f, 0.82f, 0.84f, 1);
  c[ImGuiCol_FrameBg] = ImVec4(0.895f, 0.905f, 0.915f, 1);
  c[ImGuiCol_FrameBgHovered] = ImVec4(0.85f, 0.875f, 0.90f, 1);
  c[ImGuiCol_FrameBgActive] = ImVec4(0.80f, 0.84f, 0.88f, 1);
  c[ImGuiCol_CheckMark] = accent;
  c[ImGuiCol_SliderGrab] = tint(0.5f);
  c[ImGuiCol_SliderGrabActive] = tint(0.75f);
  c[ImGuiCol_Button] = ImVec4(0.875f, 0.888f, 0.902f, 1);
  c[ImGuiCol_ButtonHovered] = ImVec4(0.81f, 0.845f, 0.88f, 1);
  c[ImGuiCol_ButtonActive] = ImVec4(0.73f, 0.79f, 0.85f, 1);
  c[ImGuiCol_Header] = ImVec4(0.912f, 0.922f, 0.932f, 1);
  c[ImGuiCol_HeaderHovered] = ImVec4(0.85f, 0.88f, 0.91f, 1);
  c[ImGuiCol_HeaderActive] = ImVec4(0.80f, 0.84f, 0.88f, 1);
  c[ImGuiCol_Separator] = ImVec4(0.85f, 0.86f, 0.875f, 1);
  c[ImGuiCol_PlotLines] = accent;
  c[ImGuiCol_PlotLinesHovered] = ImVec4(0.80f, 0.40f, 0.15f, 1);
  c[ImGuiCol_ScrollbarBg] = ImVec4(0.94f, 0.945f, 0.95f, 0.6f);
  c[ImGuiCol_ScrollbarGrab] = ImVec4(0.78f, 0.80f, 0.82f, 1);
  c[ImGuiCol_ScrollbarGrabHovered] = ImVec4(0.70f, 0.73f, 0.76f, 1);
  c[ImGuiCol_ScrollbarGrabActive] = ImVec4(0.62f, 0.66f, 0.70f, 1);
  c[ImGuiCol_TableRowBgAlt] = ImVec4(0, 0, 0, 0.025f);
  c[ImGuiCol_TextSelectedBg] = tint(0.30f);
}

}  // namespace

void set_style(float scale, float density) {
  ImGuiStyle style;
  ImGui::StyleColorsLight(&style);
  set_colours(style.Colors);
  style.WindowPadding = ImVec2(12, 10);
  style.FramePadding = ImVec2(7, 3);
  style.ItemSpacing = ImVec2(7, 5);
  style.ItemInnerSpacing = ImVec2(6, 4);
  style.ScrollbarSize = 10;
  style.GrabMinSize = 10;
  style.WindowRounding = 6;
  style.FrameRounding = 4;
  style.GrabRounding = 4;
  style.PopupRounding = 5;
  style.ScrollbarRounding = 5;
  style.WindowBorderSize = 0;
  style.FrameBorderSize = 0;
  style.ScaleAllSizes(scale);
  ImGui::GetStyle() = style;

  ImGuiIO& io = ImGui::GetIO();
  io.Fonts->Clear();
  std::error_code ignored;
  const float pixels = scale * density;
  for (const char* file : fonts)
    if (io.Fonts->Fonts.empty() && std::filesystem::exists(file, ignored))
      io.Fonts->AddFontFromFileTTF(file, float(int(14.0f * pixels)));
  if (io.Fonts->Fonts.empty()) {
    ImFontConfig config;
    config.SizePixels = 13.0f * float(std::max(1, int(pixels + 0.25f)));  // a bitmap: whole multiples only
    io.Fonts->AddFontDefault(&config);
  }
  io.FontGlobalScale = 1.0f / density;
}

}  // namespace tetpbd
