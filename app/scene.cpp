#include "app/scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>

#include "app/bodies.h"
#include "app/commands.h"
#include "app/lab/auto_solver.h"
#include "app/lab/run.h"
#include "app/lab/vary.h"
#include "app/obstacles.h"
#include "render/obstacles.h"
#include "sim/contact/starts.h"
#include "sim/error.h"
#include "sim/gl/layout.h"
#include "sim/model/did_you_mean.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace fs = std::filesystem;
using nlohmann::json, nlohmann::ordered_json;

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

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription::Block, size, cells, taper, mirror)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription::Sheet, size, cells)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription::Box, low, high, ratio, share)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription, name, mesh, surface, tetgen, fill, up, scale, height,
                                                rotation, position, density, velocity, spin, fixed, heavy, deform,
                                                thickness)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Camera, target, distance, azimuth, elevation, fov)

namespace {

constexpr std::size_t most_bytes = 1u << 20, most_depth = 32, most_tets = 30'000'000;

/// By key: "text"; "true or false"; [low, high] of a number; {"three": of each}; {"least", "most", "of", "each"} of a
/// list; null for what set_parameter() checks. Further out than 1e6 m even pairs of floats lose a body's shape.
json schema() {
  json result = json::parse(R"({
    "name": "text", "description": "text", "duration": [1e-6, 1e6],
    "bodies": {"least": 1, "most": 10000, "of": "1 to 10000 bodies", "each": {
      "name": "text", "mesh": "text", "surface": "text", "tetgen": "text", "up": "text", "deform": "text",
      "tets": [10, 1e8], "spacing": [1e-9, 1e6],
      "material": {"or": "text", "model": null}, "friction": [0, 10], "restitution": [0, 1],
      "block": {"size": {"three": [1e-6, 1e6]}, "cells": {"three": [1, 2000, "whole number"]},
        "taper": [0, 0.95], "mirror": "true or false"},
      "sheet": {"size": {"least": 2, "most": 2, "of": "two numbers", "each": [1e-6, 1e6]},
        "cells": {"least": 2, "most": 2, "of": "two numbers", "each": [1, 2000, "whole number"]}},
      "thickness": [1e-9, 1e6],
      "tet": {"least": 4, "most": 4, "of": "four points", "each": {"three": [-1e6, 1e6]}},
      "scale": {"three": [1e-6, 1e6]}, "height": [1e-6, 1e6],
      "rotation": {"three": [-3600, 3600]}, "position": {"three": [-1e6, 1e6]},
      "density": [1e-6, 1e9], "velocity": {"three": [-1e5, 1e5]}, "spin": {"three": [-1e5, 1e5]},
      "regions": {"least": 0, "most": 200, "of": "at most 200 regions", "each": {
        "low": {"three": [-1, 2]}, "high": {"three": [-1, 2]}, "centre": {"three": [-1, 2]}, "radius": [1e-6, 2],
        "tag": [-2147483648, 2147483647, "whole number"], "young_modulus": [1, 1e12], "poisson_ratio": [0, 0.499],
        "density": [1e-6, 1e9]}},
      "fixed": {"least": 0, "most": 100, "of": "at most 100 boxes {\"low\": [x,y,z], \"high\": [x,y,z]}",
        "each": {"low": {"three": [-1, 2]}, "high": {"three": [-1, 2]}}}}},
    "world": {"obstacles": {"least": 0}},
    "solver": {},
    "camera": {"target": {"three": [-1e6, 1e6]}, "distance": [1e-4, 1e6],
      "azimuth": [-360, 360], "elevation": [-89, 89], "fov": [5, 120]}
  })");
  json& body = result["bodies"]["each"];
  body["fill"]["one of"] = fill_kinds;
  body["heavy"] = body["fixed"];
  body["fibres"] = fibres_schema();
  result.update(parts_schema());
  const json motion = obstacle_schema();
  for (const char* key : {"velocity", "spin", "keyframes"}) body["fixed"]["each"][key] = motion[key];
  json& frame = body["fixed"]["each"]["keyframes"]["each"];
  frame["move"] = frame["centre"], frame.erase("centre");
  body["heavy"]["each"].update({{"ratio", {1e-9, 1e9}}, {"share", {0, 1}}});
  constexpr int most = MAX_OBSTACLES - 1;  // beside the ground
  result["world"]["obstacles"].update(
      {{"most", most}, {"of", fmt::format("at most {} obstacles", most)}, {"each", obstacle_schema()}});
  for (const Parameter& row : parameters()) {
    result[row.section][row.name] = nullptr;
    if (is_of_material(row) && row.name != "material") body["material"][row.name] = nullptr;
  }
  return result;
}

[[noreturn]] void refuse(const std::string& what, const std::string& file) {
  throw Error(what, file, "see docs/guide.md");
}

std::vector<std::string> keys_of(const json& object) {
  std::vector<std::string> keys;
  for (const auto& item : object.items()) keys.push_back(item.key());
  return keys;
}

/// Throws Error naming the key and what is allowed.
void check(const json& value, const json& allowed, const std::string& path, const std::string& file) {
  const auto require = [&](bool good, const std::string& must) {
    if (good) return;
    std::string found = value.dump(-1, ' ', false, json::error_handler_t::replace);
    if (found.size() > 40) found = found.substr(0, 37) + "...";
    refuse(fmt::format("'{}' must be {}, not {}", path, must, found), file);
  };
  const auto inner = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
  if (allowed == "text") {
    require(value.is_string(), "a text in quotes");
  } else if (allowed == "true or false") {
    require(value.is_boolean(), "true or false");
  } else if (allowed.contains("one of")) {
    require(std::ranges::find(allowed["one of"], value) != allowed["one of"].end(),
            fmt::format("one of {}", fmt::join(allowed["one of"].get<std::vector<std::string>>(), ", ")));
  } else if (allowed.is_array()) {
    const double low = allowed[0], high = allowed[1], x = value.is_number() ? value.get<double>() : NAN;
    const bool whole = allowed.size() > 2;
    require(x >= low && x <= high && (!whole || x == std::floor(x)),
            fmt::format("a {} from {:g} to {:g}", whole ? "whole number" : "number", low, high));
  } else if (allowed.contains("three")) {
    check(value, {{"least", 3}, {"most", 3}, {"of", "three numbers"}, {"each", allowed["three"]}}, path, file);
  } else if (allowed.contains("each")) {
    require(value.is_array() && value.size() >= allowed["least"] && value.size() <= allowed["most"],
            "a list of " + allowed["of"].get<std::string>());
    for (std::size_t i = 0; i < value.size(); ++i) check(value[i], allowed["each"], inner(std::to_string(i)), file);
  } else if (allowed.is_object() && !(allowed.value("or", json()) == "text" && value.is_string()) &&
             !(value == false && allowed.value("or", json()) == false)) {
    require(value.is_object(), "an object in braces");
    for (const auto& [key, held] : value.items()) {
      if (!allowed.contains(key) || key == "or") {
        std::vector<std::string> known = keys_of(allowed);
        std::erase(known, "or");
        throw Error(fmt::format("'{}' is not known here; known are {}", inner(key), fmt::join(known, ", ")), file,
                    did_you_mean(key, known) + "see docs/guide.md");
      }
      check(held, allowed[key], inner(key), file);
    }
  }
}

bool has_tets(const BodyDescription& body) { return !body.mesh.empty() && !is_surface_file(body.mesh); }

BodyDescription::Region read_region(const json& value, const std::string& where, const std::string& file) {
  BodyDescription::Region region;
  const bool box = value.contains("low") || value.contains("high"), ball = value.contains("radius");
  if (box + ball + value.contains("tag") != 1)
    refuse(fmt::format("'{}' needs a box (\"low\", \"high\"), a ball (\"centre\", \"radius\") or a \"tag\"", where),
           file);
  if (box) region.box = value.get<BodyDescription::Box>();
  if (ball) region.centre = value.value("centre", glm::dvec3(0.5)), region.radius = value["radius"];
  if (value.contains("tag")) region.tag = value["tag"].get<std::int32_t>();
  if (value.contains("density")) region.density = value["density"].get<double>();
  return region;
}

BodyDescription read_body(const json& value, const std::string& where, const std::string& file,
                          const fs::path& folder) {
  auto body = value.get<BodyDescription>();
  if (value.contains("block")) body.block = value["block"].get<BodyDescription::Block>();
  if (value.contains("sheet")) body.sheet = value["sheet"].get<BodyDescription::Sheet>();
  if (value.contains("tet")) body.tet = value["tet"].get<std::array<glm::dvec3, 4>>();
  if (value.contains("tets")) body.tets = value["tets"].get<double>();
  if (value.contains("spacing")) body.spacing = value["spacing"].get<double>();
  for (const json& region : value.value("regions", json()))
    body.regions.push_back(read_region(region, fmt::format("{}.regions.{}", where, body.regions.size()), file));
  for (const json& fibres : value.value("fibres", json()))
    body.fibres.push_back(read_fibres(fibres, fmt::format("{}.fibres.{}", where, body.fibres.size()), file));
  const int kinds = !body.mesh.empty() + bool(body.block) + bool(body.tet) + bool(body.sheet);
  if (kinds > 1 || (kinds == 0 && body.surface.empty()))
    refuse(fmt::format("'{}' needs one of \"mesh\", \"block\", \"tet\" and \"sheet\", or a \"surface\"", where), file);
  if (kinds == 0 && body.fill == "tetgen")
    refuse(fmt::format("'{}' has a surface alone, which rides on a lattice; name it as \"mesh\" for TetGen", where),
           file);
  if (body.fill == "file" && !has_tets(body))
    refuse(fmt::format("'{}.fill' is of a file of tets, and this body has none", where), file);
  if (body.thickness > 0 && (body.block || body.tet || (!body.mesh.empty() && !is_surface_file(body.mesh))))
    refuse(fmt::format("'{}.thickness' is of a sheet, or of a surface mesh that is to be one", where), file);
  if (!is_axis(body.up))
    refuse(fmt::format("'{}.up' must be \"x\", \"y\" or \"z\", not \"{}\"", where, body.up.substr(0, 40)), file);
  if (body.up != "y" && body.mesh.empty() && body.surface.empty())
    refuse(fmt::format("'{}.up' is of a mesh's file, and this body has none", where), file);
  if (!body.surface.empty() && (body.sheet || body.thickness > 0))
    refuse(fmt::format("'{}' is a sheet, which carries no surface", where), file);
  const glm::dvec3 cells = body.block ? glm::dvec3(body.block->cells) : glm::dvec3(0);
  if (cells.x * cells.y * cells.z > 2e6)
    refuse(fmt::format("'{}.block.cells' must be at most 2 million in all", where), file);
  if (body.name.empty())
    body.name = body.block   ? "block"
                : body.tet   ? "tet"
                : body.sheet ? "sheet"
                             : (body.mesh.empty() ? body.surface : body.mesh).stem().string();
  body.name = printable(body.name);
  for (const auto& [key, boxes] : {std::pair("fixed", &body.fixed), std::pair("heavy", &body.heavy)})
    for (std::size_t b = 0; b < boxes->size(); ++b)
      check_box((*boxes)[b], fmt::format("{}.{}.{}", where, key, b), file);
  for (std::size_t b = 0; b < body.fixed.size(); ++b)
    read_motion(value["fixed"][b], body.fixed[b].path, "move", fmt::format("{}.fixed.{}", where, b), file);
  for (fs::path* named : {&body.mesh, &body.surface})
    if (!named->empty()) *named = found_file(*named, folder);
  return body;
}

Scene read_scene(const json& document, const std::string& file, const fs::path& path) {
  static const json allowed = schema();
  check(document, allowed, "", file);
  check(document.value("bodies", json()), allowed["bodies"], "bodies", file);
  Scene scene;
  scene.name = printable(document.value("name", path.stem().string()));  // it is printed and stands in tables
  scene.description = document.value("description", "");
  scene.duration = document.value("duration", scene.duration);
  for (const json& body : document["bodies"])
    scene.bodies.push_back(read_body(body, fmt::format("bodies.{}", scene.bodies.size()), file, path.parent_path()));
  std::vector<std::string> names;
  for (const BodyDescription& body : scene.bodies) names.push_back(body.name);
  for (const json& one : document.value("attachments", json()))
    scene.attachments.push_back(
        read_attachment(one, names, fmt::format("attachments.{}", scene.attachments.size()), file));
  for (const json& one : document.value("forces", json()))
    scene.forces.push_back(read_force(one, names, fmt::format("forces.{}", scene.forces.size()), file));
  for (const char* section : {"world", "solver"}) read_settings(document.value(section, json()), scene.settings, file);
  read_bodies_settings(document["bodies"], scene.settings, file);
  for (const json& obstacle : document.value("/world/obstacles"_json_pointer, json()))
    scene.obstacles.push_back(
        read_obstacle(obstacle, fmt::format("world.obstacles.{}", scene.obstacles.size()), file, path.parent_path()));
  if (document.contains("camera")) scene.camera = document["camera"].get<Camera>();
  return scene;
}

// Printing and copying JSON is recursive.
bool check_depth(std::size_t depth) {
  if (depth > most_depth)
    throw Error("lists or objects are nested too deeply", "scene", fmt::format("no key needs {} levels", most_depth));
  return true;
}

/// Throws json::exception, and Error where it is nested too deeply.
template <class Text>
json parsed(Text&& text) {
  return json::parse(text, [](int depth, json::parse_event_t, json&) { return check_depth(std::size_t(depth)); });
}

// What nlohmann says, without its "[json.exception.parse_error.101] ".
std::string said(const json::exception& problem) {
  const std::string text = problem.what();
  return text.substr(text.find("] ") == std::string::npos ? 0 : text.find("] ") + 2);
}

json read_json(const fs::path& file, const char* what) {
  std::error_code error;
  if (fs::file_size(file, error) > most_bytes)
    throw Error(fmt::format("{} file is too large", what), file.string(),
                fmt::format("a {} is a few kilobytes of JSON", what));
  try {
    return parsed(std::ifstream(file, std::ios::binary));
  } catch (const json::exception& problem) {
    throw Error("not valid JSON", file.string(), said(problem));
  }
}

// "bodies.0.density=500": the value is JSON, or text where it is none.
void set_path(json& document, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Error("bad assignment", "--set " + assignment, "write PATH=VALUE, as in bodies.0.density=500");
  json value = assignment.substr(equals + 1);
  if (json::accept(value.get<std::string>())) value = parsed(value.get<std::string>());
  const std::vector<std::string> parts = split(assignment.substr(0, equals), '.');
  check_depth(parts.size());
  json* at = &document;
  try {
    for (const std::string& part : parts) at = at->is_array() ? &at->at(json::json_pointer("/" + part)) : &(*at)[part];
  } catch (const json::exception& problem) {
    throw Error("no such place in the scene", "--set " + assignment, said(problem));
  }
  *at = std::move(value);
}

// Whether it names a setting as flags and lanes do, in place of where the scene says it. Throws Error for a word that
// is neither that nor a key of scenes.
bool names_setting(const std::string& assignment) {
  static const json keys = schema();
  const std::string name = assignment.substr(0, assignment.find('='));
  if (find_parameter(name)) return true;
  if (name.find('.') == std::string::npos && !keys.contains(name) && !name.empty() && name.size() < assignment.size())
    refuse_name(name, "--set " + assignment, keys_of(keys));
  return is_setting_of_body(name) && !keys["bodies"]["each"].contains(split(name, '.')[2]);
}

bool names_mode(const std::string& assignment) { return assignment.starts_with("solver.mode="); }

// As the flag does: iterations and substeps of the file were meant for a mode of its own kind.
void set_mode_in(json& document, const std::string& assignment) {
  const auto mode = [&] {
    const json* said = &document;
    for (const char* key : {"solver", "mode"})
      if (said->is_object() && said->contains(key)) said = &(*said)[key];
    const SolverMode* found = said->is_string() ? find_solver_mode(said->get<std::string>()) : nullptr;
    return found ? found : find_solver_mode(Settings().mode);
  };
  const SolverMode* before = mode();
  set_path(document, assignment);
  if (before->solves_like(*mode()) || !document.is_object() || !document["solver"].is_object()) return;
  document["solver"].erase("iterations"), document["solver"].erase("substeps");
}

// Puts a named solver's settings in place; whether it is auto, which chooses them later.
bool apply_solver(Settings& settings, const SceneOverrides& overrides) {
  const std::string name = overrides.solver.empty() && overrides.budget_ms ? "auto" : overrides.solver;
  if (name == "auto") {
    for (const auto& [parameter, text] : overrides.parameters)
      for (const char* chosen : {"mode", "iterations", "substeps", "omega"})
        if (parameter == chosen)
          throw Error(fmt::format("--solver auto chooses {} itself", chosen), flag_name(*find_parameter(parameter)),
                      "leave out one of the two");
    return true;
  }
  if (overrides.budget_ms)
    throw Error("a budget is for --solver auto", fmt::format("--solver {} --budget-ms", name),
                "leave out one of the two");
  if (!name.empty() && !apply_preset(settings, solver_presets(), name))
    throw Error("no such solver", "--solver " + name,
                did_you_mean(name, preset_names(solver_presets())) +
                    fmt::format("choose from auto, {}", fmt::join(preset_names(solver_presets()), ", ")));
  return false;
}

// The body's own tets, without a surface that it carries.
TetMesh mesh_of(const BodyDescription& body, const std::string& scene) {
  if (const auto& b = body.block)
    return b->taper > 0 ? make_spindle(b->size, b->cells, b->taper, b->mirror)
                        : make_block(b->size, b->cells, b->mirror);
  if (body.sheet) return make_sheet(body.sheet->size, body.sheet->cells);
  if (body.tet) {
    TetMesh mesh{{body.tet->begin(), body.tet->end()}, {{0, 1, 2, 3}}, {}};
    finish_tets(mesh, fmt::format("body '{}' of scene '{}'", body.name, scene));
    return mesh;
  }
  if (body.thickness > 0) return sheet_of(load_surface(body.mesh), body.mesh.string());
  return load_mesh(body.mesh, body.tetgen);
}

/// A body's tets, and what rides on them where it is not their own boundary. Tets of a file stay as flat as they are
/// unless the body is soft: a hard one takes no shorter steps for them.
Filled body_of(const BodyDescription& body, const std::string& scene, bool soft) {
  const fs::path& file = body.mesh.empty() ? body.surface : body.mesh;
  const bool made = body.block || body.sheet || body.tet || body.thickness > 0;
  const bool filled_here = !made && is_surface_file(file) && fs::is_regular_file(file);
  const auto options_for = [&](const std::vector<glm::dvec3>& positions) {
    FillOptions options = fill_options(body.mesh.empty() ? "lattice" : body.fill, body.tetgen, body.tets, body.spacing,
                                       fmt::format("body '{}' of scene '{}'", body.name, scene));
    const double height = bounds(positions).high.y - bounds(positions).low.y;
    options.scale = body.scale * (body.height > 0 && height > 0 ? body.height / (height * body.scale.y) : 1.0);
    options.progress = fill_progress(printable(file.string()));
    return options;
  };
  Filled result;
  if (filled_here) {
    SurfaceMesh surface = load_surface(file);
    for (glm::dvec3& p : surface.positions) p = upright(p, body.up);
    result = fill(surface, options_for(surface.positions), file.string());
  } else {
    result.mesh = mesh_of(body, scene);
    for (glm::dvec3& p : result.mesh.positions) p = upright(p, body.up);
  }
  if (!made && !filled_here) {
    FillOptions options = options_for(result.mesh.positions);
    if (!soft && options.by.empty() && !options.sized) options.by = "file";
    result = refill(std::move(result.mesh), options, file.string());
  }
  if (!result.note.empty())
    print_error(fmt::format("tetpbd: {}: {}\n", printable(file.string()), printable(result.note)));
  if (!body.surface.empty() && !(filled_here && body.mesh.empty())) {
    SurfaceMesh fine = load_surface(body.surface);
    for (glm::dvec3& p : fine.positions) p = upright(p, body.up) * result.scale;
    result.carried = carry(fine, result.mesh, body.surface.string());
    result.fit.gap = NAN;  // how far it is from the tets has not been measured
  }
  return result;
}

// By tet, the number from 1 on of the last region that its middle is in, and its density over the body's.
struct TetRegions {
  std::vector<std::uint8_t> number;
  std::vector<double> density;
};
TetRegions find_regions(const BodyDescription& body, const TetMesh& mesh, const Bounds& own, const std::string& scene) {
  TetRegions found{std::vector<std::uint8_t>(mesh.tets.size()), std::vector<double>(mesh.tets.size(), 1)};
  const glm::dvec3 extent = own.high - own.low;
  const double largest = std::max({extent.x, extent.y, extent.z});
  for (std::size_t r = 0; r < body.regions.size(); ++r) {
    const BodyDescription::Region& region = body.regions[r];
    const auto place = [&] { return fmt::format("'regions.{}' of body '{}' of {}", r, body.name, scene); };
    if (region.tag && mesh.tags.size() != mesh.tets.size())
      throw Error("the body's tets have no tags", place(),
                  "name a .msh with physical groups or an .ele with an attribute, or give a box");
    bool any = false;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
      glm::dvec3 middle(0);
      for (const std::uint32_t v : mesh.tets[t]) middle += mesh.positions[v] / 4.0;
      const glm::dvec3 at = middle - own.low;
      bool inside = region.tag && mesh.tags[t] == *region.tag;
      if (region.box)
        inside = glm::all(glm::lessThanEqual(region.box->low * extent, at)) &&
                 glm::all(glm::lessThanEqual(at, region.box->high * extent));
      if (region.radius > 0) inside = glm::distance(at, region.centre * extent) <= region.radius * largest;
      if (!inside) continue;
      any = true, found.number[t] = std::uint8_t(r + 1);
      found.density[t] = region.density.value_or(body.density) / body.density;
    }
    if (!any) throw Error("a region holds no tet", place(), "make it larger; low, high and centre are fractions");
  }
  return found;
}

// Moves so many of these points, m, about the middle of where they start.
Fixture fixture_of(const Path& from_start, std::vector<std::uint32_t> vertices,
                   const std::vector<glm::dvec3>& positions) {
  std::vector<glm::dvec3> held;
  for (const std::uint32_t v : vertices) held.push_back(positions[v]);
  Fixture fixture{0, 0, std::move(vertices), from_start};
  fixture.path.centre = bounds(held).centre();
  for (Path::Key& key : fixture.path.keyframes) key.centre += fixture.path.centre;
  return fixture;
}

// How many times the mass of each vertex is that of a body of one density.
std::vector<double> region_mass_factors(const TetMesh& mesh, const TetRegions& regions) {
  std::vector<double> mass(mesh.positions.size()), plain(mesh.positions.size());
  const std::vector<double> volumes = tet_volumes(mesh);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const std::uint32_t v : mesh.tets[t]) {
      const double own = volumes[t] * fill_of(mesh, t);
      mass[v] += regions.density[t] * own, plain[v] += own;
    }
  for (std::size_t v = 0; v < mass.size(); ++v) mass[v] = plain[v] > 0 ? mass[v] / plain[v] : 1;
  return mass;
}

void add_carried(CarriedSurface& all, const CarriedSurface& more, std::size_t first_tet) {
  const auto base = std::uint32_t(all.vertices.size());
  for (auto [tet, weights] : more.vertices) all.vertices.push_back({tet + std::uint32_t(first_tet), weights});
  for (const auto& [a, b, c] : more.triangles) all.triangles.push_back({a + base, b + base, c + base});
}

}  // namespace

void read_settings(const json& section, Settings& settings, const std::string& file) {
  for (const Parameter& row : parameters())  // the mode first, which decides what others mean
    if (const auto value = section.find(row.name); value != section.end())
      set_parameter(settings, row, setting_text(row, *value), file);
}

std::vector<CameraKey> read_camera_path(const fs::path& file) {
  if (!fs::is_regular_file(file))
    throw Error("no such camera path", file.string(), "give a file: a list of cameras in JSON");
  json allowed = schema()["camera"];
  allowed.update({{"time", {0, 1e9}}, {"azimuth", {-1e6, 1e6}}});
  json keys = read_json(file, "camera path");
  check(keys, {{"least", 1}, {"most", 10000}, {"of", "cameras with their time"}, {"each", allowed}}, "path",
        file.string());
  std::vector<CameraKey> path;
  for (json whole = Camera(); const json& key : keys) {
    whole.update(key);
    if (!key.contains("time") || (!path.empty() && !(key["time"] > path.back().time)))
      refuse(fmt::format("'path.{}.time' must be there, and later than the one before", path.size()), file.string());
    path.push_back({key["time"], whole.get<Camera>()});
  }
  return path;
}

std::vector<std::string> scene_names(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(models_folder() / folder, error))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

FillOptions fill_options(const std::string& by, const std::string& switches, const std::optional<double>& tets,
                         const std::optional<double>& spacing, const std::string& where) {
  if ((by == "tetgen" || by == "file") && (tets || spacing))
    throw Error(fmt::format("{} is of a lattice", tets ? "tets" : "spacing"), where,
                by == "file" ? "a file's tets stay as they are: leave out one of the two"
                             : "TetGen's switch a says how large tets are: leave out one of the two");
  if (tets && spacing)
    throw Error("tets and spacing both say how fine a lattice is", where, "leave out one of the two");
  return {.by = by == "auto" ? "" : by,
          .switches = switches,
          .size = {tets.value_or(LatticeSize().tets), spacing.value_or(0)},
          .sized = tets || spacing};
}

Scene load_scene(const std::string& name_or_file, const SceneOverrides& overrides) {
  fs::path file = name_or_file;
  std::error_code error;
  if (!fs::is_regular_file(file, error) && file.extension() != ".json")
    file = models_folder() / "scenes" / (name_or_file + ".json");
  if (!fs::is_regular_file(file, error)) {
    const bool hard = name_or_file.starts_with("hard/");
    std::vector<std::string> names = scene_names(hard ? "scenes/hard" : "scenes");
    for (std::string& name : names) name.insert(0, hard ? "hard/" : "");
    throw Error(
        "no such scene", name_or_file,
        did_you_mean(name_or_file, names) + fmt::format("give a .json file or one of {} in {}", fmt::join(names, ", "),
                                                        (models_folder() / "scenes").string()));
  }
  json document = read_json(file, "scene");
  if (document.is_object() && document.contains("state_hash"))
    throw Error("these are the numbers of a run, not its scene", file.string(),
                fmt::format("give {}", (file.parent_path() / "scene.json").string()));
  for (const std::string& assignment : overrides.set)
    if (names_mode(assignment)) set_mode_in(document, assignment);
  for (const std::string& assignment : overrides.set)
    if (!names_mode(assignment) && !names_setting(assignment)) set_path(document, assignment);
  std::string where = file.string();
  if (!overrides.set.empty()) where += fmt::format(" with --set {}", fmt::join(overrides.set, " --set "));
  Scene scene = read_scene(document, where, file);
  const auto said = [&](const char* key) {
    return document.contains(json::json_pointer("/solver/" + std::string(key)));
  };
  const auto flag = [&](const char* key) {
    return std::ranges::any_of(overrides.parameters, [&](const auto& given) { return given.first == key; }) ||
           std::ranges::any_of(overrides.set, [&](const std::string& given) {
             return given.starts_with(fmt::format("solver.{}=", key)) || given.starts_with(fmt::format("{}=", key));
           });
  };
  scene.mode_open = !flag("mode") && !flag("iterations") && !flag("substeps") && overrides.solver.empty() &&
                    !overrides.budget_ms &&
                    (flag("material") || !(said("mode") || said("iterations") || said("substeps")));
  const bool by_trying = apply_solver(scene.settings, overrides);
  for (const std::string& given : overrides.set)
    if (const std::size_t equals = given.find('='); names_setting(given))
      assign(scene.settings, given.substr(0, equals), given.substr(equals + 1), "--set " + given, scene.bodies.size());
  for (const auto& [name, text] : overrides.parameters)
    assign(scene.settings, name, text, flag_name(*find_parameter(name)));
  if (by_trying) scene.budget_ms = overrides.budget_ms.value_or(default_budget_ms(scene.settings));
  if (!overrides.mesh.empty()) {
    BodyDescription& body = scene.bodies[0];
    body.name = overrides.mesh.stem().string();
    body.mesh = overrides.mesh;
    body.surface.clear();
    body.up = "y";
    body.fill = "auto", body.tets.reset(), body.spacing.reset();
    body.block.reset(), body.tet.reset(), body.sheet.reset();
    scene.name = printable(fmt::format("{} with {}", scene.name, body.mesh.filename().string()));
    if (std::ranges::none_of(overrides.set, [](const auto& given) { return given.starts_with("camera"); }))
      scene.camera.reset();  // it was chosen for another body
  }
  if (!overrides.up.empty()) {
    BodyDescription& body = scene.bodies[0];
    if (!is_axis(overrides.up)) throw Error("no such axis", "--up " + overrides.up, "choose from x, y, z");
    if (body.mesh.empty() && body.surface.empty())
      throw Error("the first body is from no file", "--up " + overrides.up, "name one by --mesh");
    body.up = overrides.up;
  }
  if (overrides.height) scene.bodies[0].height = *overrides.height;
  scene.by_device = overrides.by_device;
  const bool jacobi = flag("mode") || said("mode") || flag("omega") || flag("mass_splitting");
  scene.mode_open = scene.mode_open || (scene.by_device && !jacobi && overrides.solver.empty() &&
                                        !overrides.budget_ms && all_materials(scene.settings, hard));
  const bool says_contact = document.contains("/world/contact"_json_pointer) || flag("contact");
  if (!says_contact && scene.bodies.size() > 1) scene.settings.contact = "bodies";
  if (overrides.fill == "file" && std::ranges::none_of(scene.bodies, has_tets))
    throw Error("no body is from a file of tets", "--fill file", "leave it out, or name one by --mesh");
  for (BodyDescription& body : scene.bodies) {
    if (!overrides.tetgen.empty()) body.tetgen = overrides.tetgen;
    if (!overrides.fill.empty() && (overrides.fill != "file" || has_tets(body))) {
      body.fill = overrides.fill;
      if (body.fill != "lattice") body.tets.reset(), body.spacing.reset();  // of the scene's lattice
    }
    if (overrides.tets) body.tets = overrides.tets, body.spacing.reset();
    if (overrides.spacing) body.spacing = overrides.spacing, body.tets.reset();
    if (!overrides.deform.empty()) body.deform = overrides.deform;
  }
  return scene;
}

std::string why_unused(const Settings& s, const std::string& name) {
  const auto is = [&](auto... names) { return ((name == names) || ...); };
  const SolverMode& mode = solver_mode(s);
  if (mode.leapfrog && is("iterations")) return "mode explicit has no iterations";
  if (!mode.leapfrog && is("stability", "mass_scaling")) return "it is of mode explicit";
  if (!mode.jacobi && is("omega", "mass_splitting")) return fmt::format("mode {} averages nothing", s.mode);
  if (is("mass_splitting") && any_material(s, compliant))
    return "with compliance or a material masses are always split";
  if (const Parameter& row = *find_parameter(name); is_of_material(row) && all_have_own_materials(s))
    return fmt::format("each body has a material of its own: change it by --set bodies.0.material.{}=VALUE",
                       row.name == "material" ? "model" : row.name);
  if (s.material == "none" && is("young_modulus", "poisson_ratio", "element")) return "there is no material";
  if (is("element") && s.material == "springs") return "springs have no tets";
  if (is("smoothing") && !smoothed(in_mode(s, s))) return "no tets are smoothed";
  if (s.material != "none" && (is("constraints") || name.starts_with("k_") || name.starts_with("compliance_")))
    return "the material stands in its place";
  for (const ConstraintKind& kind : constraint_kinds)
    if (is(std::string("k_") + kind.name, std::string("compliance_") + kind.name) && !uses(s, kind))
      return fmt::format("{} is not among the constraints", kind.name);
  if (is("ground_height") && !s.ground) return "there is no ground";
  if (is("contact_distance") && s.contact == "none") return "bodies do not touch each other";
  if (is("rigid_contact") && !any_material(s, hard)) return "the bodies are not hard";
  return {};
}

void note_unused(const Settings& settings, const std::vector<std::string>& modes, const SceneOverrides& overrides) {
  for (const std::string& mode : modes.empty() ? std::vector{settings.mode} : modes)
    if (const SolverMode* row = find_solver_mode(mode); row && any_material(settings, smoothed) && !row->smoothed)
      print_error(fmt::format("tetpbd: mode {} has no smoothed tets, and solves linear ones\n", mode));
  for (const auto& [name, text] : overrides.parameters) {
    const std::string key = find_parameter(name)->name;
    std::string why = why_unused(settings, key);
    for (const std::string& mode : modes) {
      Settings own = settings;
      own.mode = mode;
      if (why = find_solver_mode(mode) ? why_unused(own, key) : ""; why.empty()) break;
    }
    if (!why.empty())
      print_error(fmt::format("tetpbd: {} changes nothing: {}\n", flag_name(*find_parameter(key)), why));
  }
}

json body_json(const BodyDescription& body) {
  json result = body;
  const auto put_path = [&](const char* key, const fs::path& file) {
    if (file.empty())
      result.erase(key);
    else
      result[key] = file_name(file);
  };
  put_path("mesh", body.mesh), put_path("surface", body.surface);
  if (body.block || body.tet || body.sheet || body.thickness > 0) result.erase("tetgen");
  if (body.tets) result["tets"] = *body.tets;
  if (body.spacing) result["spacing"] = *body.spacing;
  if (body.up == "y") result.erase("up");
  if (body.height == 0) result.erase("height");
  if (body.thickness == 0) result.erase("thickness");
  for (std::size_t b = 0; b < body.fixed.size(); ++b) {
    json& box = result["fixed"][b];
    box.erase("ratio"), box.erase("share");
    put_motion(box, body.fixed[b].path, "move");
  }
  for (const BodyDescription::Region& region : body.regions) {
    json one = region.box ? json{{"low", region.box->low}, {"high", region.box->high}} : json::object();
    if (region.radius > 0) one = {{"centre", region.centre}, {"radius", region.radius}};
    if (region.tag) one["tag"] = *region.tag;
    if (region.density) one["density"] = *region.density;
    result["regions"].push_back(one);
  }
  for (const FibresDescription& fibres : body.fibres) result["fibres"].push_back(part_json(fibres));
  if (body.block) result["block"] = *body.block;
  if (body.tet) result["tet"] = *body.tet;
  if (body.sheet) result["sheet"] = *body.sheet;
  return result;
}

ordered_json scene_json(const Scene& scene) {
  ordered_json result = {{"name", scene.name}, {"description", scene.description}};
  for (const BodyDescription& body : scene.bodies) result["bodies"].push_back(ordered_json(body_json(body)));
  for (std::size_t b = 0; b < scene.settings.bodies.size(); ++b) {
    ordered_json own = body_settings_json(scene.settings.bodies[b]);
    const ordered_json moduli = own.value("regions", ordered_json::array());
    own.erase("regions");
    result["bodies"][b].update(own);
    for (std::size_t r = 0; r < moduli.size(); ++r) result["bodies"][b]["regions"][r].update(moduli[r]);
  }
  for (const AttachmentDescription& one : scene.attachments)
    result["attachments"].push_back(ordered_json(part_json(one)));
  for (const ForceDescription& one : scene.forces) result["forces"].push_back(ordered_json(part_json(one)));
  for (const Parameter& row : parameters()) result[row.section][row.name] = setting_json(scene.settings, row);
  result["world"]["obstacles"] = ordered_json::array();
  for (const Obstacle& obstacle : scene.obstacles)
    result["world"]["obstacles"].push_back(ordered_json(obstacle_json(obstacle)));
  if (scene.camera) result["camera"] = ordered_json(json(*scene.camera));
  result["duration"] = scene.duration;
  return result;
}

std::string setting_text(const Parameter& row, const json& value) {
  std::string text = value.is_string() ? value.get<std::string>() : value.dump();
  if (row.name != "constraints" || !value.is_array()) return text;
  std::erase_if(text, [](char c) { return c == '[' || c == ']' || c == '"'; });
  return text.empty() ? "none" : text;
}

std::shared_ptr<Model> build_model(const Scene& scene) {
  auto model = std::make_shared<Model>();
  bool carries = false;
  for (const BodyDescription& body : scene.bodies) {
    Filled filled = body_of(body, scene.name, compliant(material_of(scene.settings, model->bodies.size())));
    TetMesh& mesh = filled.mesh;
    const CarriedSurface& carried = filled.carried;
    const bool sized = !mesh.fill.empty();  // before it was filled
    carries = carries || !carried.triangles.empty();
    if (!mesh.tets.empty())  // a sheet is drawn as itself
      add_carried(model->carried, carried.triangles.empty() ? carry_boundary(mesh) : carried, model->rest.tets.size());
    if (!sized)
      for (auto& p : mesh.positions) p *= body.scale;
    if (model->rest.tets.size() + mesh.tets.size() > most_tets)
      throw Error("the scene is too large", fmt::format("body '{}' of {}", body.name, scene.name),
                  fmt::format("keep to {} tets in all", most_tets));
    const glm::dmat3 turn = rotation_of(body.rotation);
    // Fixed and heavy vertices are chosen in the mesh's own frame, before it is turned.
    const Bounds own = bounds(mesh.positions);
    const glm::dvec3 extent = glm::max(own.high - own.low, glm::dvec3(1e-300));
    // A flat side of a surface is nearly flat on its lattice: a box as thin as a plane takes what is near it.
    const glm::dvec3 least = mesh.fill.empty() ? glm::dvec3(0) : 0.3 * mean_edge(mesh) / extent;
    const auto is_in = [&](std::size_t vertex, const PartBox& box) {
      const glm::dvec3 away = (mesh.positions[vertex] - own.low) / extent - 0.5 * (box.low + box.high);
      return glm::all(glm::lessThanEqual(glm::abs(away), glm::max(0.5 * (box.high - box.low) + 1e-9, least)));
    };
    std::vector<std::uint32_t> fixed;
    TetRegions regions;
    std::vector<double> mass_factors(mesh.positions.size(), 1);
    if (!body.regions.empty())
      regions = find_regions(body, mesh, own, scene.name), mass_factors = region_mass_factors(mesh, regions);
    std::mt19937 generator{std::uint32_t(scene.settings.seed)};
    std::vector<std::vector<char>> in_fixed(body.fixed.size());  // before the mesh is turned
    for (std::size_t b = 0; b < body.fixed.size(); ++b) {
      for (std::size_t i = 0; i < mesh.positions.size(); ++i) in_fixed[b].push_back(is_in(i, body.fixed[b]));
      if (!std::ranges::count(in_fixed[b], 1))
        throw Error("a fixed region holds no vertex",
                    fmt::format("'fixed.{}' of body '{}' of {}", b, body.name, scene.name),
                    "low and high are fractions of the body's bounding box: make it larger");
    }
    choose_parts({*model, mesh, turn, is_in}, scene.attachments, scene.forces, body.fibres);
    for (std::uint32_t i = 0; i < mesh.positions.size(); ++i) {
      if (std::ranges::any_of(in_fixed, [&](const auto& inside) { return bool(inside[i]); })) fixed.push_back(i);
      for (const BodyDescription::Box& heavy : body.heavy) {
        const bool chosen = double(generator()) / 4294967296.0 < heavy.share;
        if (chosen && is_in(i, heavy)) mass_factors[i] *= heavy.ratio;
      }
    }
    if (body.height > 0 && !(own.high.y > own.low.y))
      throw Error("a flat sheet has no height", fmt::format("body '{}' of {}", body.name, scene.name),
                  "give scale or size");
    if (const std::string units = question_units(own.high - own.low);
        !body.mesh.empty() && body.height == 0 && !units.empty())
      print_error(fmt::format("tetpbd: {}: body '{}' is {}\n", scene.name, body.name, units));
    const double scale = body.height > 0 && !sized ? body.height / (own.high.y - own.low.y) : 1.0;
    for (auto& p : mesh.positions) p = turn * ((p - own.centre()) * scale);
    const Bounds placed = bounds(mesh.positions);
    const glm::dvec3 bottom(placed.centre().x, placed.low.y, placed.centre().z);
    for (auto& p : mesh.positions) p += body.position - bottom;
    if (mesh.tets.empty()) mesh.thickness = body.thickness > 0 ? body.thickness : 1e-3 * placed.size();
    std::vector<glm::dvec3> start = mesh.positions;
    deform(start, mesh, body.deform, unsigned(scene.settings.seed) + 0x9e3779b9u * unsigned(model->bodies.size()));
    Fit& fit = filled.fit;  // a lattice is as large as it will be
    fit.thinnest_at = turn * (fit.thinnest_at - own.centre()) + body.position - bottom;
    if ((!body.mesh.empty() || !body.surface.empty()) && !mesh.tets.empty())
      model->fills.push_back({model->bodies.size(), filled.note, fit});
    for (std::size_t b = 0; b < body.fixed.size(); ++b) {
      if (!moves(body.fixed[b].path)) continue;
      std::vector<std::uint32_t> held;
      for (std::uint32_t i = 0; i < start.size(); ++i)
        if (in_fixed[b][i]) held.push_back(i);
      model->fixtures.push_back(fixture_of(body.fixed[b].path, std::move(held), start));
      Fixture& made = model->fixtures.back();
      made.body = model->bodies.size(), made.region = b;
      for (std::uint32_t& v : made.vertices) v += std::uint32_t(model->positions.size());
    }
    if (const auto& has = scene.settings.bodies; !has.empty() && !has[model->bodies.size()].regions.empty()) {
      model->regions.resize(model->rest.tets.size());
      model->regions.insert(model->regions.end(), regions.number.begin(), regions.number.end());
    }
    add_body(*model, body.name, mesh, body.density, start, body.velocity, body.spin, fixed, mass_factors);
  }
  if (!carries) model->carried = {};
  if (!model->regions.empty()) model->regions.resize(model->rest.tets.size());
  for (const Obstacle& obstacle : scene.obstacles) {
    model->obstacles.push_back(obstacle);
    load_field(model->obstacles.back());
  }
  renumber(*model);
  model->start_motions = separate_starts(*model, scene.settings);
  for (const StartMotion& motion : model->start_motions)
    print_error(fmt::format("tetpbd: {}: {}\n", scene.name, describe(motion)));
  finish_parts(*model, scene.attachments, scene.forces, scene.settings, scene.name);
  return model;
}

Camera scene_camera(const Scene& scene, const Model& model, float aspect) {
  if (scene.camera) return *scene.camera;
  Bounds box = bounds(model.positions);
  const Bounds rest = bounds(model.rest.positions);
  box.low = glm::min(box.low, rest.low);
  box.high = glm::max(box.high, rest.high);
  box = with_obstacles(box, model, 0, 2 * box.size());
  if (scene.settings.ground) box.low.y = std::min(box.low.y, scene.settings.ground_height);
  Camera camera;
  frame_box(camera, glm::vec3(box.low), glm::vec3(box.high), aspect);
  return camera;
}

}  // namespace tetpbd
