// Meshes that TetGen made, kept in the user's cache folder (cache_file.h).
#pragma once

#include "sim/mesh/cache_file.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Of the surface's bits, the switches and the mesher's version.
CacheKey mesh_key(const SurfaceMesh& surface, const std::string& switches);
/// Empty when there is no home for a cache.
std::filesystem::path mesh_file(const CacheKey& key);
/// Nothing when it is not there, damaged, or of another key.
std::optional<TetMesh> read_mesh(const CacheKey& key);
/// The same of a file's bytes.
std::optional<TetMesh> parse_mesh(std::string_view bytes, const CacheKey& key);
std::string mesh_bytes(const CacheKey& key, const TetMesh& mesh);
void keep_mesh(const CacheKey& key, const TetMesh& mesh);

/// Of a surface file's bytes and format, the switches and the readers' versions; nothing if it cannot be
/// read.
std::optional<CacheKey> source_key(const std::filesystem::path& surface, const std::string& switches);
/// The mesh that was made of such a file, found without parsing it.
std::optional<TetMesh> read_mesh_of(const CacheKey& source);
/// Notes that `mesh` is the key of what was made of it.
void keep_source(const CacheKey& source, const CacheKey& mesh);

}  // namespace tetpbd
