#include "sim/mesh/mesh_cache.h"

#include <assimp/version.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>

#include "sim/mesh/bytes.h"
#include "sim/parallel.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

// Change it whenever the file's layout, the mesher or what is done with its result changes.
constexpr std::string_view maker = "tetpbd cache 1, TetGen 1.5.0";

constexpr CacheMagic magic{'t', 'e', 't', 'p', 'b', 'd', 'M', '1'};
constexpr CacheMagic source_magic{'t', 'e', 't', 'p', 'b', 'd', 'S', '1'};

// Damage passes the checksum only by malice, but a cache folder may be shared: what is taken is a mesh.
bool is_sound(const TetMesh& mesh) {
  std::atomic<bool> sound = !mesh.tets.empty();
  const auto require = [&sound](std::size_t count, const auto& holds) {
    parallel_for(count, [&](std::size_t first, std::size_t end) {
      for (std::size_t i = first; i < end; ++i)
        if (!holds(i)) sound = false;
    });
  };
  const auto in_range = [&](const auto& element) {
    return std::all_of(element.begin(), element.end(),
                       [&](std::uint32_t v) { return v < mesh.positions.size(); });
  };
  require(mesh.tets.size(), [&](std::size_t i) {
    return in_range(mesh.tets[i]) && tet_volume(mesh, mesh.tets[i]) > 0;  // false for NaN as well
  });
  require(mesh.surface.size(), [&](std::size_t i) { return in_range(mesh.surface[i]); });
  require(mesh.positions.size(),
          [&](std::size_t i) { return glm::length(mesh.positions[i]) < largest_coordinate; });
  return sound;
}

}  // namespace

CacheKey mesh_key(const SurfaceMesh& surface, const std::string& switches) {
  std::string bytes = fmt::format("{}\n{}\n", maker, switches);
  put_array(bytes, surface.positions);
  put_array(bytes, surface.triangles);
  return cache_key(bytes);
}

fs::path mesh_file(const CacheKey& key) {
  const fs::path folder = cache_folder();
  return folder.empty() ? folder : folder / (cache_name(key) + ".tets");
}

std::optional<TetMesh> parse_mesh(std::string_view bytes, const CacheKey& key) {
  std::optional<std::string_view> content = unwrap_cached(bytes, magic, key);
  TetMesh mesh;
  const bool whole = content && take_array(*content, mesh.positions) && take_array(*content, mesh.tets) &&
                     take_array(*content, mesh.surface) && content->empty() && is_sound(mesh);
  if (!whole) return {};
  return mesh;
}

std::string mesh_bytes(const CacheKey& key, const TetMesh& mesh) {
  std::string content;
  put_array(content, mesh.positions);
  put_array(content, mesh.tets);
  put_array(content, mesh.surface);
  return wrap_cached(magic, key, content);
}

std::optional<TetMesh> read_mesh(const CacheKey& key) {
  constexpr std::size_t most = std::size_t{16} << 30;
  const std::optional<std::string> bytes = read_cached(mesh_file(key), most);
  if (!bytes) return {};
  return parse_mesh(*bytes, key);
}

std::optional<CacheKey> source_key(const fs::path& surface, const std::string& switches) {
  constexpr std::size_t most = std::size_t{1} << 30;  // parsing a larger one takes what hashing saves
  const std::optional<std::string> content = read_cached(surface, most);
  if (!content) return {};
  return cache_key(fmt::format("{}, assimp {}.{}.{}\n{}\n{}\n", maker, aiGetVersionMajor(),
                               aiGetVersionMinor(), aiGetVersionPatch(), switches, lower_extension(surface)) +
                   *content);
}

namespace {
fs::path source_file(const CacheKey& source) {
  const fs::path folder = cache_folder();
  return folder.empty() ? folder : folder / (cache_name(source) + ".source");
}
}  // namespace

std::optional<TetMesh> read_mesh_of(const CacheKey& source) {
  const std::optional<std::string> bytes = read_cached(source_file(source), 1000);
  const auto content = bytes ? unwrap_cached(*bytes, source_magic, source) : std::nullopt;
  CacheKey mesh;
  if (!content || content->size() != sizeof mesh) return {};
  std::memcpy(mesh.data(), content->data(), sizeof mesh);
  return read_mesh(mesh);
}

void keep_source(const CacheKey& source, const CacheKey& mesh) {
  const std::string_view content(reinterpret_cast<const char*>(mesh.data()), sizeof mesh);
  if (const fs::path file = source_file(source); !file.empty())
    write_cached(file, wrap_cached(source_magic, source, content));
}

void keep_mesh(const CacheKey& key, const TetMesh& mesh) {
  if (const fs::path file = mesh_file(key); !file.empty()) write_cached(file, mesh_bytes(key, mesh));
}

}  // namespace tetpbd
