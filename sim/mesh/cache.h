// Meshes that TetGen made, in the user's cache folder: a checksum with the key in it, then the arrays. A
// cache that cannot be read or written costs time, never an error.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Not cryptographic: it finds accidents.
std::uint64_t hash_bytes(std::string_view bytes, std::uint64_t seed);

/// Of the surface's bits, the switches and the program that fills it.
std::uint64_t mesh_key(const SurfaceMesh& surface, const std::string& switches,
                       const std::filesystem::path& program);
/// Nothing when it is not there, damaged, cut short, or of another key.
std::optional<TetMesh> read_mesh(std::uint64_t key);
void keep_mesh(std::uint64_t key, const TetMesh& mesh);
/// The same as a file's bytes.
std::optional<TetMesh> parse_mesh(std::string_view bytes, std::uint64_t key);
std::string mesh_bytes(std::uint64_t key, const TetMesh& mesh);

}  // namespace tetpbd
