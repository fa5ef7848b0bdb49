// Meshes that TetGen made, kept in the user's cache folder: $TETPBD_CACHE, else $XDG_CACHE_HOME/tetpbd, else
// ~/.cache/tetpbd. A cache that cannot be read or written costs time, never an error.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sim/tet_mesh.h"

namespace tetpbd {

using CacheKey = std::array<std::uint64_t, 2>;

/// Of the surface's bits, the switches and the mesher's version.
CacheKey cache_key(const SurfaceMesh& surface, const std::string& switches);
/// Empty when there is no home for a cache.
std::filesystem::path cache_file(const CacheKey& key);
/// Nothing when it is not there, damaged, or of another key.
std::optional<TetMesh> read_cache(const CacheKey& key);
/// The same of a file's bytes.
std::optional<TetMesh> parse_cache(std::string_view bytes, const CacheKey& key);
std::string cache_bytes(const CacheKey& key, const TetMesh& mesh);
void write_cache(const CacheKey& key, const TetMesh& mesh);

}  // namespace tetpbd
