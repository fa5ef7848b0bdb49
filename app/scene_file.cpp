#include "app/scene_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "app/bodies.h"
#include "app/files.h"
#include "app/obstacles.h"
#include "render/obstacles.h"
#include "sim/error.h"
#include "sim/gl/layout.h"
#include "sim/model/did_you_mean.h"

namespace tetpbd {

namespace fs = std::filesystem;
using nlohmann::json, nlohmann::ordered_json;

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription::Block, size, cells, taper, mirror)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription::Sheet, size, cells)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription::Box, low, high, ratio, share)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BodyDescription, name, mesh, surface, tetgen, fill, up, scale, height,
                                                rotation, position, density, velocity, spin, fixed, heavy, deform,
                                                thickness)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Camera, target, distance, azimuth, elevation, fov)

bool has_tets(const BodyDescription& body) { return !body.mesh.empty() && !is_surface_file(body.mesh); }

namespace {

constexpr std::size_t most_bytes = 1u << 20, most_depth = 32;

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
        std::vector<std::string> known = keys(allowed);
        std::erase(known, "or");
        throw Error(fmt::format("'{}' is not known here; known are {}", inner(key), fmt::join(known, ", ")), file,
                    did_you_mean(key, known) + "see docs/guide.md");
      }
      check(held, allowed[key], inner(key), file);
    }
  }
}

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
    refuse(
        fmt::format("'{}' has only an embedded surface, which needs a lattice; give it as \"mesh\" for TetGen", where),
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

}  // namespace

const json& scene_schema() {
  static const json allowed = schema();
  return allowed;
}

Scene read_scene(const json& document, const std::string& file, const fs::path& path) {
  const json& allowed = scene_schema();
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

static bool check_event(int depth, json::parse_event_t, json&) { return check_depth(std::size_t(depth)); }

json parse_json(const std::string& text) { return json::parse(text, check_event); }

std::string message_of(const json::exception& problem) {
  const std::string text = problem.what();
  return text.substr(text.find("] ") == std::string::npos ? 0 : text.find("] ") + 2);
}

json read_json(const fs::path& file, const char* what) {
  std::error_code error;
  if (fs::file_size(file, error) > most_bytes)
    throw Error(fmt::format("{} file is too large", what), file.string(),
                fmt::format("a {} is a few kilobytes of JSON", what));
  try {
    return json::parse(std::ifstream(file, std::ios::binary), check_event);
  } catch (const json::exception& problem) {
    throw Error("not valid JSON", file.string(), message_of(problem));
  }
}

void read_settings(const json& section, Settings& settings, const std::string& file) {
  for (const Parameter& row : parameters())  // the mode first, which decides what others mean
    if (const auto value = section.find(row.name); value != section.end())
      set_parameter(settings, row, setting_text(row, *value), file);
}

std::vector<CameraKey> read_camera_path(const fs::path& file) {
  if (!fs::is_regular_file(file))
    throw Error("no such camera path", file.string(), "give a file: a list of cameras in JSON");
  json allowed = scene_schema()["camera"];
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

}  // namespace tetpbd
