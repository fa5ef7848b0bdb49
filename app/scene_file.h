// The JSON of scenes: what is allowed in it, how it is read and written (docs/guide.md).
#pragma once

#include <nlohmann/json.hpp>

#include "app/scene.h"

namespace tetpbd {

/// What a scene may hold, by key; parameters() and parts of bodies among it.
const nlohmann::json& scene_schema();
/// A scene's or a camera path's file. Throws Error where it is too large, too deep, or no JSON.
nlohmann::json read_json(const std::filesystem::path& file, const char* what);
/// Throws json::exception, and Error where it is nested too deeply.
nlohmann::json parse_json(const std::string& text);
/// Throws Error where a path or a document is nested more deeply than any key needs.
bool check_depth(std::size_t depth);
/// What nlohmann says, without its "[json.exception.parse_error.101] ".
std::string message_of(const nlohmann::json::exception& problem);
/// Checks all of it; `file` is named in errors, meshes are looked for beside `path`.
Scene read_scene(const nlohmann::json& document, const std::string& file, const std::filesystem::path& path);
/// Whether the body's mesh is a file of tets.
bool has_tets(const BodyDescription& body);

}  // namespace tetpbd
