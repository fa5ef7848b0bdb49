// Scenes in the panel: pictures to choose from, files, and what was done to the settings.
#include <GL/glew.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include "app/files.h"
#include "app/ui.h"
#include "app/widgets.h"
#include "sim/error.h"

namespace tetpbd {

namespace {

namespace fs = std::filesystem;

// What a scene file says of itself, and the picture beside it; read when first shown.
const SceneCard& card_of(Session& s, const fs::path& file) {
  const auto [found, fresh] = s.ui.cards.try_emplace(file.string());
  SceneCard& card = found->second;
  if (!fresh) return card;
  try {
    if (file.extension() == ".json") card.description = load_scene(file.string()).description;
  } catch (const Error& error) {
    card.description = error.what();
  }
  if (const auto image = read_png(fs::path(file).replace_extension("png"))) {
    card.picture = Texture("picture of a scene");
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, image->width, image->height, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                 image->rgba.data());
    glGenerateMipmap(GL_TEXTURE_2D);  // shown smaller than it is
  }
  return card;
}

bool card(Session& s, const std::string& name, const fs::path& file) {
  const SceneCard& card = card_of(s, file);
  const ImGuiStyle& style = ImGui::GetStyle();
  const float line = ImGui::GetTextLineHeight(), high = 4.5f * line,
              wide = high * picture_width / picture_height;
  const ImVec2 at = ImGui::GetCursorScreenPos(), end(at.x + wide, at.y + high);
  const float room = ImGui::GetContentRegionAvail().x;
  const bool chosen =
      ImGui::Selectable(("##" + file.string()).c_str(), name == s.loaded.name, 0, ImVec2(0, high));
  mark(s, "scene=" + name);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  if (card.picture)
    draw.AddImage(ImTextureID(std::intptr_t(card.picture.id())), at, end);
  else
    draw.AddRectFilled(at, end, ImGui::GetColorU32(ImGuiCol_FrameBg));
  const ImVec2 text(end.x + style.ItemSpacing.x, at.y);
  draw.AddText(text, ImGui::GetColorU32(ImGuiCol_Text), name.c_str());
  draw.AddText(nullptr, 0, ImVec2(text.x, text.y + 1.2f * line), ImGui::GetColorU32(ImGuiCol_Text, 0.7f),
               card.description.c_str(), nullptr, room - wide - style.ItemSpacing.x);
  return chosen;
}

void draw_scenes(Session& s) {
  const std::string id = begin_row(s, "scene");
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowSizeConstraints(ImVec2(std::min(30 * ImGui::GetFontSize(), display.x), 0),
                                      ImVec2(display.x, 0.8f * display.y));
  if (ImGui::BeginCombo(id.c_str(), s.loaded.scene.name.c_str())) {
    for (const std::string& name : scene_names())
      if (card(s, name, models_folder() / "scenes" / (name + ".json"))) load_soon(s, name, {}, false, false);
    std::error_code error;
    bool first = true;
    for (const std::string& file : s.ui.kept.recent) {
      if (!fs::is_regular_file(file, error)) continue;
      if (std::exchange(first, false)) ImGui::TextDisabled("opened before");
      if (card(s, fs::path(file).filename().string(), file)) {
        open_file(s, file);
        break;
      }
      if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", file.c_str());
    }
    ImGui::EndCombo();
  }
  end_row(s, "scene", s.loaded.scene.description + "\non the command line: --scene");
}

}  // namespace

void draw_scene(Session& s) {
  draw_scenes(s);
  begin_row(s, "open file");
  ImGui::SetNextItemWidth(-ImGui::CalcTextSize("Load").x - 3 * ImGui::GetStyle().ItemSpacing.x);
  bool load_it =
      ImGui::InputTextWithHint("##mesh", "path, Enter", &s.ui.mesh, ImGuiInputTextFlags_EnterReturnsTrue);
  end_row(s, "mesh",
          "a scene (.json), or a mesh in place of this scene's first body: .ply .obj .stl .off surfaces, "
          ".node/.ele .msh tetrahedra. A file can also be dropped onto the window");
  ImGui::SameLine();
  load_it |= button(s, "Load", "load", "opens the file of this path");
  if (load_it && !s.ui.mesh.empty()) open_file(s, s.ui.mesh);
  const float gap = ImGui::GetStyle().ItemSpacing.x, width = (ImGui::GetContentRegionAvail().x - 2 * gap) / 3;
  if (button(s, "Save scene", "save scene",
             "the scene with the settings and the view of now, into a file in the current folder\nCtrl+S",
             width))
    save_scene(s);
  ImGui::SameLine();
  ImGui::BeginDisabled(s.changes.past.empty());
  if (button(s, "Undo", "undo", "takes back the last change of a setting\nCtrl+Z", width)) undo(s);
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(s.changes.future.empty());
  if (button(s, "Redo", "redo", "what was taken back, again\nCtrl+Y, Ctrl+Shift+Z", width)) redo(s);
  ImGui::EndDisabled();
}

}  // namespace tetpbd
