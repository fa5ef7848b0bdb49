// Choosing a file to open, by walking through folders.
#include <imgui.h>

#include <algorithm>
#include <cctype>
#include <string_view>

#include "app/window/ui.h"
#include "app/window/widgets.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

namespace {

namespace fs = std::filesystem;

bool can_be_opened(const fs::path& file) {
  std::string ending = file.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  if (ending == ".json" || ending == ".state") return true;
  for (const std::string& word : split(mesh_formats, ' '))
    if (ending == word || ending + "," == word) return true;
  return false;
}

// Folders first. What cannot be read has nothing in it.
void list_folder(FileList& list) {
  list.entries.clear();
  std::error_code error;
  for (fs::directory_iterator entry(list.folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    const fs::path& path = entry->path();
    const bool folder = entry->is_directory(unknown);
    if (path.filename().string().starts_with('.') || (!folder && !can_be_opened(path))) continue;
    list.entries.push_back({path.filename().string(), folder});
  }
  std::ranges::sort(list.entries, {}, [](const FileList::Entry& e) { return std::pair(!e.folder, e.name); });
}

}  // namespace

void draw_file_button(Session& s, float width) {
  FileList& list = s.ui.files;
  if (button(s, "Browse", "browse", "scenes, states and meshes, in folders", width)) {
    if (list.folder.empty()) {
      std::error_code error;
      list.folder = fs::current_path(error);
    }
    list_folder(list);
    ImGui::OpenPopup("files");
  }
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float wide = std::min(36 * ImGui::GetFontSize(), display.x), high = 0.6f * display.y;
  ImGui::SetNextWindowSize(ImVec2(wide, high));
  if (!ImGui::BeginPopup("files")) return;
  ImGui::TextWrapped("%s", list.folder.string().c_str());
  ImGui::Separator();
  std::optional<fs::path> entered;
  if (ImGui::Selectable("..", false, ImGuiSelectableFlags_DontClosePopups)) entered = list.folder.parent_path();
  mark(s, "file=..");
  for (const auto& [name, folder] : list.entries) {
    const std::string shown = folder ? name + "/" : name;
    const int flags = folder ? ImGuiSelectableFlags_DontClosePopups : ImGuiSelectableFlags_None;
    if (ImGui::Selectable(shown.c_str(), false, flags)) {
      if (folder)
        entered = list.folder / name;
      else
        open_file(s, list.folder / name);
    }
    mark(s, "file=" + shown);
  }
  if (list.entries.empty()) ImGui::TextDisabled("nothing here that can be opened");
  if (entered) {
    list.folder = *entered;
    list_folder(list);
    s.log("folder {}", list.folder.string());
  }
  ImGui::EndPopup();
}

}  // namespace tetpbd
