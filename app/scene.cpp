#include "app/scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "app/auto_solver.h"
#include "sim/error.h"
#include "sim/layout.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path models_folder() {
  if (const char* folder = std::getenv("TETPBD_MODELS")) return folder;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    const fs::path installed = program.parent_path().parent_path() / "share/tetpbd/models";
    if (fs::is_directory(installed, error)) return installed;
  }
  return TETPBD_SOURCE_MODELS;
}

namespace {

/// An object of the scene whose keys are taken one by one; what is left over is an error.
class Keys {
 public:
  Keys(const json& object, std::string where, std::string file)
      : object_(object), where_(std::move(where)), file_(std::move(file)) {
    if (!object.is_object()) fail(where_.empty() ? "the scene" : where_, "must be an object in braces");
  }

  [[noreturn]] void fail(const std::string& key, const std::string& must) const {
    throw Error(fmt::format("'{}' {}", key, must), file_, "see docs/scenes.md");
  }
  std::string path(const std::string& key) const { return where_.empty() ? key : where_ + "." + key; }
  const std::string& file() const { return file_; }

  const json* find(const std::string& key) {
    taken_.insert(key);
    const auto found = object_.find(key);
    return found == object_.end() ? nullptr : &*found;
  }

  double number(const json& value, const std::string& key, double low, double high) const {
    if (!value.is_number() || !std::isfinite(value.get<double>()) || value.get<double>() < low ||
        value.get<double>() > high)
      fail(key, fmt::format("must be a number from {:g} to {:g}, not {}", low, high, shown(value)));
    return value.get<double>();
  }
  void read(const std::string& key, double& target, double low, double high) {
    if (const json* value = find(key)) target = number(*value, path(key), low, high);
  }
  void read(const std::string& key, float& target, double low, double high) {
    double wide = double(target);
    read(key, wide, low, high);
    target = float(wide);
  }
  void read(const std::string& key, std::string& target) {
    if (const json* value = find(key)) {
      if (!value->is_string()) fail(path(key), "must be a text in quotes, not " + shown(*value));
      target = value->get<std::string>();
    }
  }
  template <class Vector>
  void read_vector(const std::string& key, Vector& target, double low, double high, bool whole = false) {
    const json* value = find(key);
    if (!value) return;
    if (!value->is_array() || value->size() != 3)
      fail(path(key), "must be a list of three numbers, not " + shown(*value));
    for (int a = 0; a < 3; ++a) {
      const double x = number((*value)[std::size_t(a)], fmt::format("{}.{}", path(key), a), low, high);
      if (whole && x != std::floor(x)) fail(path(key), "must be a list of three whole numbers");
      target[a] = typename Vector::value_type(x);
    }
  }
  void finish() const {
    for (const auto& [key, value] : object_.items())
      if (!taken_.contains(key))
        fail(path(key), fmt::format("is not known here; known are {}", fmt::join(taken_, ", ")));
  }

 private:
  static std::string shown(const json& value) {
    std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
    if (text.size() > 40) text = text.substr(0, 37) + "...";
    return text;
  }
  const json& object_;
  std::string where_, file_;
  std::set<std::string> taken_;
};

// What a scene file may ask for, whoever wrote it.
constexpr std::size_t most_bytes = 1u << 20, most_boxes = 100, most_tets = 30'000'000;
constexpr int most_depth = 32;

constexpr double far = 1e6;  // metres; further out even pairs of floats lose a body's shape

void read_settings(Keys& keys, const char* section, Settings& settings) {
  for (const Parameter& row : parameters()) {
    if (std::string_view(row.section) != section) continue;
    const json* value = keys.find(row.name);
    if (!value) continue;
    std::string text;
    if (value->is_array()) {
      for (const json& word : *value) {
        if (!word.is_string()) keys.fail(keys.path(row.name), "must be a list of names");
        text += (text.empty() ? "" : ",") + word.get<std::string>();
      }
      if (text.empty()) text = "none";
    } else if (value->is_string()) {
      text = value->get<std::string>();
    } else {
      text = value->dump();
    }
    set_parameter(settings, row, text, keys.file());
  }
}

// `file` names the scene in errors; meshes are looked for in `folder` first.
BodyDescription read_body(const json& value, const std::string& where, const std::string& file,
                          const fs::path& folder) {
  Keys keys(value, where, file);
  BodyDescription body;
  std::string mesh;
  keys.read("name", body.name);
  keys.read("mesh", mesh);
  keys.read("tetgen", body.tetgen);
  keys.read_vector("scale", body.scale, 1e-6, 1e6);
  keys.read("height", body.height, 1e-6, far);
  keys.read_vector("rotation", body.rotation, -3600, 3600);
  keys.read_vector("position", body.position, -far, far);
  keys.read("density", body.density, 1e-6, 1e9);
  keys.read_vector("velocity", body.velocity, -1e5, 1e5);
  keys.read_vector("spin", body.spin, -1e5, 1e5);
  keys.read("deform", body.deform);
  if (const json* block = keys.find("block")) {
    Keys block_keys(*block, keys.path("block"), file);
    body.block = BodyDescription::Block{};
    block_keys.read_vector("size", body.block->size, 1e-6, far);
    block_keys.read_vector("cells", body.block->cells, 1, 2000, true);
    block_keys.finish();
    if (double(body.block->cells.x) * body.block->cells.y * body.block->cells.z > 2e6)
      keys.fail(keys.path("block.cells"), "must be at most 2 million cells in all");
  }
  // A list of boxes, for fixed and heavy vertices; `more` reads what else an entry holds.
  const auto read_boxes = [&](const char* key, auto more) {
    const json* list = keys.find(key);
    if (!list) return;
    if (!list->is_array() || list->size() > most_boxes)
      keys.fail(keys.path(key),
                fmt::format("must be a list of at most {} boxes {{\"low\": [x,y,z], \"high\": [x,y,z]}}",
                            most_boxes));
    for (std::size_t i = 0; i < list->size(); ++i) {
      Keys box_keys((*list)[i], fmt::format("{}.{}", keys.path(key), i), file);
      BodyDescription::Box box;
      box_keys.read_vector("low", box.low, -1, 2);
      box_keys.read_vector("high", box.high, -1, 2);
      more(box_keys, box);
      box_keys.finish();
    }
  };
  read_boxes("fixed", [&](Keys&, const BodyDescription::Box& box) { body.fixed.push_back(box); });
  read_boxes("heavy", [&](Keys& box_keys, const BodyDescription::Box& box) {
    BodyDescription::Heavy heavy{box, 1, 1};
    box_keys.read("ratio", heavy.ratio, 1e-9, 1e9);
    box_keys.read("share", heavy.share, 0, 1);
    body.heavy.push_back(heavy);
  });
  if (const json* tet = keys.find("tet")) {
    if (!tet->is_array() || tet->size() != 4) keys.fail(keys.path("tet"), "must be a list of four points");
    json points = {{"0", (*tet)[0]}, {"1", (*tet)[1]}, {"2", (*tet)[2]}, {"3", (*tet)[3]}};
    Keys tet_keys(points, keys.path("tet"), file);
    body.tet.emplace();
    for (std::size_t j = 0; j < 4; ++j) tet_keys.read_vector(std::to_string(j), (*body.tet)[j], -far, far);
  }
  keys.finish();
  if (!mesh.empty() + bool(body.block) + bool(body.tet) != 1)
    keys.fail(where, "needs one of \"mesh\", \"block\" and \"tet\"");
  if (!mesh.empty()) {
    // Beside the scene, or one of the shipped meshes.
    body.mesh = mesh;
    if (body.mesh.is_relative()) {
      const fs::path beside = folder / mesh;
      body.mesh = fs::exists(beside) ? beside : models_folder() / mesh;
    }
  }
  if (body.name.empty()) body.name = body.block ? "block" : body.tet ? "tet" : fs::path(mesh).stem().string();
  body.name = printable(body.name);
  return body;
}

Scene read_scene(const json& document, const std::string& file, const fs::path& path) {
  Keys keys(document, "", file);
  Scene scene;
  scene.name = path.stem().string();
  keys.read("name", scene.name);
  scene.name = printable(scene.name);  // it is printed and stands in tables
  keys.read("description", scene.description);
  keys.read("duration", scene.duration, 1e-6, 1e6);
  const json* bodies = keys.find("bodies");
  if (!bodies || !bodies->is_array() || bodies->empty())
    keys.fail("bodies", "must be a list with at least one body");
  for (std::size_t i = 0; i < bodies->size(); ++i)
    scene.bodies.push_back(read_body((*bodies)[i], fmt::format("bodies.{}", i), file, path.parent_path()));
  for (const char* section : {"world", "solver"}) {
    const json* value = keys.find(section);
    if (!value) continue;
    Keys section_keys(*value, section, file);
    read_settings(section_keys, section, scene.settings);
    if (const json* obstacles =
            std::string_view(section) == "world" ? section_keys.find("obstacles") : nullptr) {
      if (!obstacles->is_array() || obstacles->size() > MAX_PLANES - 1)
        keys.fail("world.obstacles", fmt::format("must be a list of at most {} planes", MAX_PLANES - 1));
      for (std::size_t i = 0; i < obstacles->size(); ++i) {
        Keys plane((*obstacles)[i], fmt::format("world.obstacles.{}", i), file);
        glm::dvec3 point{0}, normal{0};
        plane.read_vector("point", point, -far, far);
        plane.read_vector("normal", normal, -1e3, 1e3);
        plane.finish();
        if (!(glm::length(normal) > 1e-9)) plane.fail(plane.path("normal"), "must not be zero");
        normal = glm::normalize(normal);
        scene.obstacles.emplace_back(normal, glm::dot(normal, point));
      }
    }
    section_keys.finish();
  }
  if (const json* value = keys.find("camera")) {
    Keys camera_keys(*value, "camera", file);
    Camera camera;
    camera_keys.read_vector("target", camera.target, -far, far);
    camera_keys.read("distance", camera.distance, 1e-4, far);
    camera_keys.read("azimuth", camera.azimuth, -360, 360);
    camera_keys.read("elevation", camera.elevation, -89, 89);
    camera_keys.read("fov", camera.fov, 5, 120);
    camera_keys.finish();
    scene.camera = camera;
  }
  keys.finish();
  return scene;
}

// Printing and copying JSON is recursive.
bool too_deep(int depth, json::parse_event_t, json&) {
  if (depth > most_depth)
    throw Error("lists or objects are nested too deeply", "scene",
                fmt::format("no key needs {} levels", most_depth));
  return true;
}

// "bodies.0.density=500": the value is JSON, or text where it is none.
void set_path(json& document, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Error("bad assignment", "--set " + assignment, "write PATH=VALUE, as in bodies.0.density=500");
  const std::string text = assignment.substr(equals + 1);
  json value = json::parse(text, too_deep, false);
  if (value.is_discarded()) value = text;
  json* at = &document;
  const std::vector<std::string> parts = split(assignment.substr(0, equals), '.');
  if (parts.size() > most_depth)
    throw Error("no such place in the scene", "--set " + assignment.substr(0, 40) + "...",
                fmt::format("no key needs {} levels", most_depth));
  for (const std::string& part : parts) {
    if (at->is_array()) {
      const bool number = !part.empty() && part.size() < 6 &&
                          std::all_of(part.begin(), part.end(), [](char c) { return c >= '0' && c <= '9'; });
      if (!number || std::stoul(part) >= at->size())
        throw Error("no such place in the scene", "--set " + assignment,
                    fmt::format("'{}' must be an index below {}", part, at->size()));
      at = &(*at)[std::stoul(part)];
    } else if (at->is_object() || at->is_null()) {
      at = &(*at)[part];
    } else {
      throw Error("no such place in the scene", "--set " + assignment,
                  fmt::format("what '{}' is looked up in is a value", part));
    }
  }
  *at = std::move(value);
}

// Puts a named solver's settings in place; whether it is auto, which chooses them later.
bool apply_solver(Settings& settings, const SceneOverrides& overrides) {
  const std::string name = overrides.solver.empty() && overrides.budget_ms ? "auto" : overrides.solver;
  if (name == "auto") {
    for (const auto& [parameter, text] : overrides.parameters)
      for (const char* chosen : {"mode", "iterations", "substeps", "omega", "handles"})
        if (parameter == chosen)
          throw Error(fmt::format("--solver auto chooses {} itself", chosen),
                      flag_name(*find_parameter(parameter)), "leave out one of the two");
    return true;
  }
  if (overrides.budget_ms)
    throw Error("a budget is for --solver auto", fmt::format("--solver {} --budget-ms", name),
                "leave out one of the two");
  if (name.empty()) return false;
  std::vector<std::string> names{"auto"};
  for (const SolverPreset& preset : solver_presets()) {
    names.emplace_back(preset.name);
    if (name == preset.name) return apply_preset(settings, preset), false;
  }
  throw Error("no such solver", "--solver " + name, fmt::format("choose from {}", fmt::join(names, ", ")));
}

}  // namespace

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(models_folder() / "scenes", error))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

Scene load_scene(const std::string& name_or_file, const SceneOverrides& overrides) {
  fs::path file = name_or_file;
  std::error_code error;
  if (!fs::is_regular_file(file, error) && file.extension() != ".json")
    file = models_folder() / "scenes" / (name_or_file + ".json");
  if (!fs::is_regular_file(file, error) && scene_names().empty())
    throw Error("no scenes", (models_folder() / "scenes").string(),
                "point TETPBD_MODELS at the folder models/");
  if (!fs::is_regular_file(file, error))
    throw Error("no such scene", name_or_file,
                fmt::format("give a .json file or one of {}", fmt::join(scene_names(), ", ")));
  if (fs::file_size(file, error) > most_bytes)
    throw Error("scene file is too large", file.string(), "a scene is a few kilobytes of JSON");
  std::ifstream stream(file, std::ios::binary);
  json document;
  try {
    document = json::parse(stream, too_deep);
  } catch (const json::exception& problem) {
    std::string text = problem.what();
    text = text.substr(text.find("] ") == std::string::npos ? 0 : text.find("] ") + 2);
    throw Error("not valid JSON", file.string(), text);
  }
  for (const std::string& assignment : overrides.set) set_path(document, assignment);
  std::string shown = file.string();
  if (!overrides.set.empty()) shown += fmt::format(" with --set {}", fmt::join(overrides.set, " --set "));
  Scene scene = read_scene(document, shown, file);
  const bool by_trying = apply_solver(scene.settings, overrides);
  for (const auto& [name, text] : overrides.parameters) {
    const Parameter& row = *find_parameter(name);
    set_parameter(scene.settings, row, text, flag_name(row));
  }
  if (by_trying) scene.budget_ms = overrides.budget_ms.value_or(default_budget_ms(scene.settings));
  if (!overrides.mesh.empty()) {
    scene.bodies[0].mesh = overrides.mesh;
    scene.bodies[0].block.reset();
    scene.bodies[0].tet.reset();
    scene.bodies[0].name = overrides.mesh.stem().string();
  }
  for (BodyDescription& body : scene.bodies) {
    if (!overrides.tetgen.empty()) body.tetgen = overrides.tetgen;
    if (!overrides.deform.empty()) body.deform = overrides.deform;
  }
  return scene;
}

std::shared_ptr<const Model> build_model(const Scene& scene) {
  auto model = std::make_shared<Model>();
  for (const BodyDescription& body : scene.bodies) {
    TetMesh mesh;
    if (body.block) {
      mesh = make_block(body.block->size, body.block->cells);
    } else if (body.tet) {
      mesh.positions.assign(body.tet->begin(), body.tet->end());
      mesh.tets = {{0, 1, 2, 3}};
      finish_tets(mesh, fmt::format("body '{}' of scene '{}'", body.name, scene.name));
    } else {
      mesh = load_mesh(body.mesh, body.tetgen);
    }
    for (auto& p : mesh.positions) p *= body.scale;
    if (model->rest.tets.size() + mesh.tets.size() > most_tets)
      throw Error("the scene is too large", fmt::format("body '{}' of {}", body.name, scene.name),
                  fmt::format("keep to {} tets in all", most_tets));
    glm::dmat4 turn(1);
    for (int axis = 2; axis >= 0; --axis) {
      glm::dvec3 direction(0);
      direction[axis] = 1;
      turn = glm::rotate(turn, glm::radians(body.rotation[axis]), direction);
    }
    // Fixed and heavy vertices are chosen in the mesh's own frame, before it is turned.
    const Bounds own = bounds(mesh.positions);
    const auto is_in = [&](std::size_t vertex, const BodyDescription::Box& box) {
      const glm::dvec3 part =
          (mesh.positions[vertex] - own.low) / glm::max(own.high - own.low, glm::dvec3(1e-300));
      return glm::all(glm::greaterThanEqual(part, box.low - 1e-9)) &&
             glm::all(glm::lessThanEqual(part, box.high + 1e-9));
    };
    std::vector<std::uint32_t> fixed;
    std::vector<double> mass_factors(mesh.positions.size(), 1);
    std::mt19937 generator{std::uint32_t(scene.settings.seed)};
    for (std::uint32_t i = 0; i < mesh.positions.size(); ++i) {
      if (std::any_of(body.fixed.begin(), body.fixed.end(), [&](const auto& box) { return is_in(i, box); }))
        fixed.push_back(i);
      for (const BodyDescription::Heavy& heavy : body.heavy) {
        const bool chosen = double(generator()) / 4294967296.0 < heavy.share;
        if (chosen && is_in(i, heavy.box)) mass_factors[i] *= heavy.ratio;
      }
    }
    const double scale = body.height > 0 ? body.height / (own.high.y - own.low.y) : 1.0;
    for (auto& p : mesh.positions) p = glm::dvec3(turn * glm::dvec4((p - own.centre()) * scale, 0));
    const Bounds placed = bounds(mesh.positions);
    const glm::dvec3 bottom(placed.centre().x, placed.low.y, placed.centre().z);
    for (auto& p : mesh.positions) p += body.position - bottom;
    std::vector<glm::dvec3> start = mesh.positions;
    deform(start, mesh, body.deform, unsigned(scene.settings.seed));
    add_body(*model, body.name, mesh, body.density, start, body.velocity, body.spin, fixed, mass_factors);
  }
  model->obstacles = scene.obstacles;
  renumber(*model);
  return model;
}

Camera scene_camera(const Scene& scene, const Model& model, float aspect) {
  if (scene.camera) return *scene.camera;
  Bounds box = bounds(model.positions);
  const Bounds rest = bounds(model.rest.positions);
  box.low = glm::min(box.low, rest.low);
  box.high = glm::max(box.high, rest.high);
  if (scene.settings.ground) box.low.y = std::min(box.low.y, scene.settings.ground_height);
  Camera camera;
  frame_box(camera, glm::vec3(box.low), glm::vec3(box.high), aspect);
  return camera;
}

}  // namespace tetpbd
