#include "app/obstacles.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <ranges>

#include "app/files.h"
#include "app/scene.h"
#include "sim/contact/obstacle_kinds.h"
#include "sim/error.h"
#include "sim/model/did_you_mean.h"

namespace tetpbd {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

void make_heights(Obstacle& o) {
  if (o.image.empty()) return set_heights(o, o.heights);
  const auto image = read_png(o.image);
  if (!image || image->width < 2 || image->height < 2)
    throw Error("no picture of heights", o.image.string(), "give a PNG of 2 to 1024 pixels a side");
  std::vector<std::vector<double>> rows(std::size_t(image->height));
  for (std::size_t p = 0; p < image->rgba.size(); p += 4)
    rows[p / 4 / std::size_t(image->width)].push_back((image->rgba[p] + image->rgba[p + 1] + image->rgba[p + 2]) /
                                                      765.0);
  set_heights(o, rows);
}

}  // namespace

fs::path found_file(const fs::path& name, const fs::path& folder) {
  return (fs::exists(folder / name) ? folder : models_folder()) / name;
}

fs::path file_name(const fs::path& file) {
  const auto whole = [](const fs::path& path) { return fs::absolute(path).lexically_normal(); };
  const fs::path shipped = whole(file).lexically_relative(whole(models_folder()));
  return shipped.empty() || *shipped.begin() == ".." ? whole(file) : shipped;
}

json obstacle_schema() {
  return json::parse(R"({
    "shape": "text", "point": {"three": [-1e6, 1e6]}, "normal": {"three": [-1e3, 1e3]},
    "centre": {"three": [-1e6, 1e6]}, "rotation": {"three": [-3600, 3600]},
    "radius": [1e-6, 1e6], "half_length": [1e-6, 1e6], "half": {"three": [1e-6, 1e6]},
    "image": "text", "mesh": "text", "scale": {"three": [1e-6, 1e6]}, "height": [1e-6, 1e6],
    "voxels": [8, 256, "whole number"],
    "heights": {"least": 2, "most": 1024, "of": "2 to 1024 rows of heights", "each":
      {"least": 2, "most": 1024, "of": "2 to 1024 heights from 0 to 1", "each": [0, 1]}},
    "friction": [0, 10], "restitution": [0, 1],
    "velocity": {"three": [-1e5, 1e5]}, "spin": {"three": [-1e5, 1e5]},
    "keyframes": {"least": 1, "most": 1000, "of": "1 to 1000 keyframes", "each":
      {"time": [1e-9, 1e9], "centre": {"three": [-1e6, 1e6]}, "rotation": {"three": [-1e6, 1e6]}}}
  })");
}

Obstacle read_obstacle(const json& value, const std::string& where, const std::string& file, const fs::path& folder) {
  const auto refuse = [&](const std::string& key, const std::string& what,
                          const std::string& mend = "see docs/guide.md") {
    throw Error(fmt::format("'{}.{}' {}", where, key, what), file, mend);
  };
  Obstacle o;
  const std::string shape = value.value("shape", o.kind->name);
  o.kind = find_obstacle_kind(shape);
  if (!o.kind) {
    std::vector<std::string> names;
    for (const ObstacleKind& kind : obstacle_kinds()) names.push_back(kind.name);
    refuse("shape", fmt::format("is no shape; there are {}", fmt::join(names, ", ")),
           did_you_mean(shape, names) + "see docs/guide.md");
  }
  for (const std::string& key : o.kind->needs)
    if (!value.contains(key)) refuse(key, fmt::format("is missing: a {} needs it", shape));
  static const std::vector<std::string> all = {"shape", "friction", "restitution", "velocity", "spin", "keyframes"};
  for (const auto& [key, held] : value.items())
    if (!o.kind->has(key) && !std::ranges::count(all, key)) refuse(key, fmt::format("is nothing that a {} has", shape));
  const auto get = [&](const char* key, auto& to) {
    if (value.contains(key)) value[key].get_to(to);
  };
  get("point", o.centre), get("centre", o.centre), get("normal", o.normal), get("rotation", o.rotation);
  get("radius", o.radius), get("half_length", o.half_length), get("half", o.half);
  get("heights", o.heights), get("scale", o.scale), get("height", o.height), get("voxels", o.voxels);
  if (value.contains("friction")) o.friction = value["friction"];
  if (value.contains("restitution")) o.restitution = value["restitution"];
  if (o.kind->has("normal") && !(glm::length(o.normal) > 1e-9)) refuse("normal", "must not be zero");
  if (o.kind->has("heights") && value.contains("image") == value.contains("heights"))
    refuse("heights", "or an image, one of the two, must be there");
  for (const auto& row : o.heights)
    if (row.size() != o.heights[0].size()) refuse("heights", "must be rows of the same length");
  for (const char* key : {"image", "mesh"})
    if (value.contains(key)) {
      const fs::path path = found_file(value[key].get<std::string>(), folder);
      if (!fs::is_regular_file(path)) refuse(key, fmt::format("is no file: {}", path.string()));
      (key[0] == 'i' ? o.image : o.mesh) = path;
    }
  read_motion(value, o, "centre", where, file);
  return o;
}

void read_motion(const json& value, Path& path, const char* place, const std::string& where, const std::string& file) {
  if (value.contains("velocity")) value["velocity"].get_to(path.velocity);
  if (value.contains("spin")) value["spin"].get_to(path.spin);
  const json frames = value.value("keyframes", json::array());
  if (!frames.empty() && (value.contains("velocity") || value.contains("spin")))
    throw Error(fmt::format("'{}.keyframes' already say how it moves", where), file, "leave out velocity and spin");
  Path::Key key{0, path.centre, path.rotation};
  for (const json& frame : frames) {
    const double time = frame.value("time", 0.0);
    if (!(time > key.time))
      throw Error(
          fmt::format("'{}.keyframes.{}.time' must be later than the one before, and 0", where, path.keyframes.size()),
          file, "see docs/guide.md");
    key.time = time;
    if (frame.contains(place)) frame[place].get_to(key.centre);
    if (frame.contains("rotation")) frame["rotation"].get_to(key.rotation);
    path.keyframes.push_back(key);
  }
}

void put_motion(json& value, const Path& path, const char* place) {
  if (path.velocity != glm::dvec3(0)) value["velocity"] = path.velocity;
  if (path.spin != glm::dvec3(0)) value["spin"] = path.spin;
  for (const Path::Key& key : path.keyframes)
    value["keyframes"].push_back({{"time", key.time}, {place, key.centre}, {"rotation", key.rotation}});
}

json obstacle_json(const Obstacle& o) {
  json result = json::object();
  const auto put = [&](const char* key, const auto& held) {
    if (o.kind->has(key)) result[key] = held;
  };
  if (o.kind != default_obstacle_kind()) result["shape"] = o.kind->name;
  put("point", o.centre), put("centre", o.centre), put("normal", o.normal), put("rotation", o.rotation);
  put("radius", o.radius), put("half_length", o.half_length), put("half", o.half);
  if (!o.image.empty()) result["image"] = file_name(o.image);
  if (!o.heights.empty()) result["heights"] = o.heights;
  if (o.kind->has("mesh")) result["mesh"] = file_name(o.mesh);
  put("scale", o.scale), put("voxels", o.voxels);
  if (o.height > 0) result["height"] = o.height;
  if (o.friction) result["friction"] = *o.friction;
  if (o.restitution) result["restitution"] = *o.restitution;
  put_motion(result, o, "centre");
  return result;
}

void load_field(Obstacle& o) {
  if (o.kind->has("heights")) make_heights(o);
  if (!o.kind->has("mesh")) return;
  SurfaceMesh surface = load_surface(o.mesh);
  for (glm::dvec3& p : surface.positions) p *= o.scale;
  const Bounds box = bounds(surface.positions);
  const double scale = o.height > 0 ? o.height / std::max(box.high.y - box.low.y, 1e-300) : 1;
  for (glm::dvec3& p : surface.positions) p = (p - box.centre()) * scale;
  o.field = std::make_shared<const DistanceField>(distance_field(surface, o.voxels, o.mesh.string()));
  o.surface = std::make_shared<const SurfaceMesh>(std::move(surface));
}

}  // namespace tetpbd
