// Scenes in the panel: pictures to choose from, files, and what was done to the settings.
#include <GL/glew.h>
#include <imgui_internal.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cmath>

#include "app/files.h"
#include "app/window/edit_obstacles.h"
#include "app/window/ui.h"
#include "app/window/widgets.h"
#include "sim/contact/obstacle_kinds.h"
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
  const float line = ImGui::GetTextLineHeight(), high = 4.5f * line, wide = high * picture_width / picture_height;
  const ImVec2 at = ImGui::GetCursorScreenPos(), end(at.x + wide, at.y + high);
  const float room = ImGui::GetContentRegionAvail().x;
  const bool chosen = ImGui::Selectable(("##" + file.string()).c_str(), name == s.loaded.name, 0, ImVec2(0, high));
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

// Three numbers, or one.
bool drag_field(Session& s, const char* label, double* value, int count, double speed, double low, const char* format,
                const char* help) {
  constexpr double most = 1e6;
  const std::string id = begin_row(s, label);
  ImGui::PushMultiItemsWidths(count, ImGui::CalcItemWidth());
  bool changed = false;
  for (int k = 0; k < count; ++k) {
    if (k > 0) ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
    changed |= edit_number(s, fmt::format("{} {}", id, k), label, value[k], low, most, format, false, float(speed));
    if (count > 1) mark(s, fmt::format("{} {}", label, "xyz"[k]));
    ImGui::PopItemWidth();
  }
  end_row(s, label, help);
  return changed;
}

// Of its own, or the world's, to which a right click goes back.
bool own_or_worlds(Session& s, const char* label, std::optional<double>& own, double worlds, double most) {
  double value = own.value_or(worlds);
  if (!slider(s, label, value, worlds, 0, most, "%.3g", "of its own; right click: the world's")) return false;
  own = value == worlds ? std::nullopt : std::optional(value);
  return true;
}

bool obstacle_fields(Session& s, Obstacle& o) {
  const Settings& world = asked_settings(s);
  const double step = 0.005 * s.loaded.sim().model->size, least = 1e-3 * s.loaded.sim().model->size;
  const ObstacleKind& kind = *o.kind;
  bool changed = false, others = false;
  glm::dvec3 centre = o.centre, rotation = o.rotation;
  if (drag_field(s, "centre", &centre.x, 3, step, -1e6, "%.3f", "m, at the start"))
    move_by(o, centre - o.centre), changed = true;
  if (kind.has("rotation") &&
      drag_field(s, "rotation", &rotation.x, 3, 1, -3600, "%.1f", "degrees about x, then y, then z")) {
    for (Obstacle::Key& key : o.keyframes) key.rotation += rotation - o.rotation;
    o.rotation = rotation, changed = true;
  }
  if (kind.has("normal")) {
    const glm::dvec3 before = o.normal;
    if (drag_field(s, "normal", &o.normal.x, 3, 0.01, -1e3, "%.2f", "points to where bodies may be"))
      glm::length(o.normal) > 1e-3 ? void(changed = true) : void(o.normal = before);
  }
  if (kind.has("radius")) changed |= drag_field(s, "radius", &o.radius, 1, step, least, "%.3f m", "m");
  if (kind.has("half_length"))
    changed |= drag_field(s, "half length", &o.half_length, 1, step, least, "%.3f m", "m, along its own y axis");
  if (kind.has("half"))
    others |= drag_field(s, "half", &o.half.x, 3, step, least, "%.3f", "m, half lengths along its own axes");
  if (kind.has("mesh") && o.height > 0) others |= drag_field(s, "height", &o.height, 1, step, least, "%.3f m", "m");
  changed |= own_or_worlds(s, "its friction", o.friction, world.friction, 2);
  changed |= own_or_worlds(s, "its restitution", o.restitution, world.restitution, 1);
  if (o.keyframes.empty()) {
    changed |= drag_field(s, "velocity", &o.velocity.x, 3, step, -1e5, "%.2f", "m/s; all start anew");
    changed |= drag_field(s, "spin", &o.spin.x, 3, 0.02, -1e5, "%.2f", "rad/s about its centre; all start anew");
  } else {
    ImGui::TextDisabled("moves through %zu keyframes", o.keyframes.size());
  }
  if (others) o.field = nullptr;
  return changed || others;
}

}  // namespace

void draw_scene(Session& s) {
  draw_scenes(s);
  begin_row(s, "open file");
  const float gap = ImGui::GetStyle().ItemSpacing.x, browse = ImGui::CalcTextSize("Browse").x + 2 * gap;
  ImGui::SetNextItemWidth(-browse - gap);
  const bool open =
      ImGui::InputTextWithHint("##mesh", "path to a scene or mesh", &s.ui.mesh, ImGuiInputTextFlags_EnterReturnsTrue);
  end_row(
      s, "mesh",
      fmt::format(
          "a scene (.json), a state (.state), or a mesh in place of this scene's first body: {}. A file can also be "
          "dropped onto the window",
          mesh_formats));
  ImGui::SameLine();
  draw_file_button(s, browse);
  if (open && !s.ui.mesh.empty()) open_file(s, s.ui.mesh);
  const float all = ImGui::GetContentRegionAvail().x - 3 * gap;
  const float width = 0.3f * all, narrow = 0.2f * all;
  if (button(s, "Save scene", "save scene",
             "the scene with the settings and the view of now, into a file in the current folder\nCtrl+S", width))
    save_scene(s);
  ImGui::SameLine();
  if (button(s, "Save state", "save state",
             "the state of now, into a file in the current folder: open it to go on from there\non the command line: "
             "--from-state",
             width))
    save_state_file(s);
  ImGui::SameLine();
  ImGui::BeginDisabled(s.changes.past.empty());
  if (button(s, "Undo", "undo", "takes back the last change of a setting\nCtrl+Z", narrow)) undo(s);
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(s.changes.future.empty());
  if (button(s, "Redo", "redo", "what was taken back, again\nCtrl+Y, Ctrl+Shift+Z", narrow)) redo(s);
  ImGui::EndDisabled();
}

void draw_obstacles(Session& s) {
  Words kinds;
  for (const ObstacleKind& kind : obstacle_kinds()) kinds.push_back(kind.name);
  if (const auto chosen = combo(s, "add obstacle", "", kinds,
                                "one more, beside the bodies; a mesh: the file of the path above. Click on "
                                "one in the view to choose it, then drag to move, Ctrl + drag to turn"))
    add_obstacle(s, *find_obstacle_kind(*chosen));
  for (int i = 0; i < int(s.loaded.scene.obstacles.size()); ++i) {
    const Obstacle& o = s.loaded.scene.obstacles[std::size_t(i)];
    const std::string name = fmt::format("{} {}{}", i + 1, o.kind->name, moves(o) ? ", moving" : "");
    if (ImGui::Selectable(name.c_str(), i == s.obstacle)) choose_obstacle(s, i == s.obstacle ? -1 : i);
    mark(s, fmt::format("obstacle {}", i + 1));
  }
  if (s.obstacle < 0) return;
  ImGui::PushID("obstacle");
  std::vector<Obstacle> wanted = asked_obstacles(s);
  if (obstacle_fields(s, wanted[std::size_t(s.obstacle)])) change_obstacles(s, std::move(wanted));
  if (button(s, "Remove", "remove obstacle", "the chosen obstacle goes\nDelete", -1)) remove_obstacle(s);
  ImGui::PopID();
}

}  // namespace tetpbd
