// Obstacles in scene files (docs/guide.md).
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "sim/contact/obstacle.h"

namespace glm {
template <class T>
void from_json(const nlohmann::json& list, vec<3, T>& v) {
  for (int a = 0; a < 3; ++a) list.at(std::size_t(a)).get_to(v[a]);
}
template <class T>
void to_json(nlohmann::json& list, const vec<3, T>& v) {
  list = {v.x, v.y, v.z};
}
}  // namespace glm

namespace tetpbd {

/// What one may have, as scene files are checked by.
nlohmann::json obstacle_schema();
/// Its motion: velocity and spin, or keyframes, whose places stand under the key `place`. Throws Error naming `where`
/// and `file`.
void read_motion(const nlohmann::json& value, Path& path, const char* place, const std::string& where,
                 const std::string& file);
void put_motion(nlohmann::json& value, const Path& path, const char* place);
/// Of a value that has passed this check. Throws Error naming `where` and `file`; files are beside the scene,
/// in `folder`, or are shipped.
Obstacle read_obstacle(const nlohmann::json& value, const std::string& where, const std::string& file,
                       const std::filesystem::path& folder);
nlohmann::json obstacle_json(const Obstacle& obstacle);
/// Its field of heights or distances, from its files.
void load_field(Obstacle& obstacle);

/// A file of a scene: beside it, or one of those that are shipped.
std::filesystem::path found_file(const std::filesystem::path& name, const std::filesystem::path& folder);
/// As a scene says it that lies elsewhere: shipped ones by name, others by their whole path.
std::filesystem::path file_name(const std::filesystem::path& file);

}  // namespace tetpbd
