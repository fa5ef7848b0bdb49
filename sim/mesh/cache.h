// Meshes that TetGen made, in the user's cache folder: a head of magic, key and checksum, then the arrays. A
// cache that cannot be read or written costs time, never an error.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

using CacheKey = std::array<std::uint64_t, 2>;

/// 64 bits, eight bytes at a time (a gigabyte takes about half a second). Not cryptographic: it finds
/// accidents.
std::uint64_t hash_bytes(std::string_view bytes, std::uint64_t seed);

/// $TETPBD_CACHE, else $XDG_CACHE_HOME/tetpbd, else ~/.cache/tetpbd; empty where there is none of these.
std::filesystem::path cache_folder();

/// Of the surface's bits, the switches and the mesher's version.
CacheKey mesh_key(const SurfaceMesh& surface, const std::string& switches);
/// Nothing when it is not there, damaged, cut short, or of another key.
std::optional<TetMesh> read_mesh(const CacheKey& key);
void keep_mesh(const CacheKey& key, const TetMesh& mesh);
/// The same as a file's bytes.
std::optional<TetMesh> parse_mesh(std::string_view bytes, const CacheKey& key);
std::string mesh_bytes(const CacheKey& key, const TetMesh& mesh);

}  // namespace tetpbd
