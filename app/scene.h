// Scenes: JSON with strict checking (docs/guide.md), and how a scene becomes a model.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/scene_parts.h"
#include "render/camera.h"
#include "sim/mesh/fill.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"

namespace tetpbd {

inline bool is_axis(std::string_view name) { return name == "x" || name == "y" || name == "z"; }
/// A point of a file whose axis `up` ("x", "y" or "z") points upwards, in a frame where y does.
inline glm::dvec3 upright(const glm::dvec3& p, std::string_view up) {
  return up == "z" ? glm::dvec3(p.x, p.z, 0 - p.y) : up == "x" ? glm::dvec3(0 - p.y, p.x, p.z) : p;
}

/// By what a body's file is filled; auto: what suits it, file: tets that it has stay as they are.
constexpr const char* fill_kinds[] = {"auto", "tetgen", "lattice", "file"};

struct BodyDescription {
  struct Block {
    glm::dvec3 size{1};  ///< m
    glm::ivec3 cells{1};
    double taper = 0;    ///< make_spindle()
    bool mirror = true;  ///< every second cell, make_block()
  };
  struct Sheet {
    std::array<double, 2> size{1, 1};  ///< m, along x and z
    std::array<int, 2> cells{1, 1};
  };
  /// Vertices in a box; heavy ones, a pseudo-random `share`, have `ratio` times the mass of the material.
  struct Box : PartBox {
    double ratio = 1, share = 1;
    Path path{};  ///< of fixed ones, from where they start
  };
  /// Tets whose middle is in a box, in a ball, or that a file gives a number.
  struct Region {
    std::optional<Box> box;
    glm::dvec3 centre{0};               ///< fractions of the body's bounding box
    double radius = 0;                  ///< of its largest side; above 0: a ball
    std::optional<std::int32_t> tag{};  ///< TetMesh::tags
    std::optional<double> density{};    ///< kg/m^3
  };
  std::string name;
  std::filesystem::path mesh;                    ///< a file, or
  std::optional<Block> block;                    ///< a generated block, or
  std::optional<std::array<glm::dvec3, 4>> tet;  ///< a single tet, m, or
  std::optional<Sheet> sheet;                    ///< a flat sheet
  double thickness = 0;           ///< m, of a sheet, 0: a thousandth of its size; of a surface mesh, makes it a sheet
  std::filesystem::path surface;  ///< a fine one that rides on it, or, alone, on a lattice that fills it
  std::string tetgen = FillOptions().switches;
  std::string fill = "auto";      ///< one of fill_kinds
  std::optional<double> tets;     ///< about so many, of a lattice
  std::optional<double> spacing;  ///< m, of a lattice, in place of `tets`
  std::string up = "y";           ///< the axis that points upwards in both files
  glm::dvec3 scale{1};            ///< along the mesh's own axes then, before all else
  double height = 0;              ///< m, scales the mesh; 0 keeps its size
  glm::dvec3 rotation{0};         ///< degrees about x, then y, then z
  glm::dvec3 position{0};         ///< m, where the middle of the bottom of its bounding box goes
  double density = 1000;          ///< kg/m^3
  glm::dvec3 velocity{0};         ///< m/s
  glm::dvec3 spin{0};             ///< rad/s about the centre of mass
  std::vector<Box> fixed;         ///< vertices in any of these boxes are fixed
  std::vector<Box> heavy;
  std::vector<Region> regions;  ///< of several the last counts
  std::vector<FibresDescription> fibres;
  std::string deform = "none";
};

struct Scene {
  std::string name, description;
  std::vector<BodyDescription> bodies;
  std::vector<Obstacle> obstacles;
  std::vector<AttachmentDescription> attachments;
  std::vector<ForceDescription> forces;
  Settings settings;
  std::optional<Camera> camera;
  int copies = 1;                   ///< the bodies are so many times the same ones (make_copies)
  double duration = 2;              ///< s
  bool mode_open = false;           ///< nobody says how it is solved: so the bodies do (auto_solver.h)
  bool by_device = false;           ///< ... and, if they are hard, the device
  std::optional<double> budget_ms;  ///< --solver auto: settings are yet to be chosen (auto_solver.h)
};

/// What the command line puts in place of a scene's own.
struct SceneOverrides {
  std::filesystem::path mesh{};
  std::string tetgen{}, fill{}, deform{};
  std::optional<double> tets{}, spacing{};                        ///< of bodies that are lattices
  std::string solver{};                                           ///< one of solver_presets(), or auto
  std::optional<double> budget_ms{};                              ///< for auto
  std::string up{};                                               ///< of the first body's file
  std::optional<double> height{};                                 ///< of the first body; 0: its file's
  std::vector<std::pair<std::string, std::string>> parameters{};  ///< name, text
  std::vector<std::string> set{};                                 ///< PATH=VALUE
  int copies = 1;
  bool by_device = false;  ///< hard bodies that nobody says a mode for, or what Jacobi has, may take another than node
};

/// How a surface is filled; throws Error naming `where` where two of these exclude each other.
FillOptions fill_options(const std::string& by, const std::string& switches, const std::optional<double>& tets,
                         const std::optional<double>& spacing, const std::string& where);

/// A name in models/scenes, or a file. Throws Error naming file, key and allowed range.
Scene load_scene(const std::string& name_or_file, const SceneOverrides& overrides = {});
/// `run --camera-path`. What a camera does not say is as in the one before. Throws Error.
std::vector<CameraKey> read_camera_path(const std::filesystem::path& file);
std::vector<std::string> scene_names(const std::string& folder = "scenes");
/// Sets what a section of a scene says of settings. Throws Error naming `file`.
void read_settings(const nlohmann::json& section, Settings& settings, const std::string& file);
/// Why a setting changes nothing; empty where it may.
std::string why_unused(const Settings& settings, const std::string& name);
/// Says on standard error which flags of these change nothing, and why, in any of these modes; none named:
/// that of the settings.
void note_unused(const Settings& settings, const std::vector<std::string>& modes, const SceneOverrides& overrides);

/// One at least.
inline long duration_in_steps(const Scene& scene) {
  return std::max(1L, std::lround(scene.duration / scene.settings.dt));
}
/// As a scene file says it, wherever it lies: shipped meshes by name, others by their whole path.
nlohmann::json body_json(const BodyDescription& body);
/// A scene file with nothing left to defaults: the same run, to the bit.
nlohmann::ordered_json scene_json(const Scene& scene);
/// The text that set_parameter() takes; lists are those of words.
std::string setting_text(const Parameter& row, const nlohmann::json& value);
/// Its bodies so many times in one place, which do not act on each other: many small runs in the dispatches of one.
/// Throws Error where they would touch.
void make_copies(Scene& scene, int copies);
/// Meshes loaded and tetrahedralised, placed, deformed. Throws Error for copies that memory cannot hold.
std::shared_ptr<Model> build_model(const Scene& scene);
/// The scene's camera, or one that sees the start and the ground below it.
Camera scene_camera(const Scene& scene, const Model& model, float aspect);

/// Of shipped meshes and scenes: $TETPBD_MODELS, beside the installed program, or the source folder.
std::filesystem::path models_folder();

}  // namespace tetpbd
