#include "sim/mesh_cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "sim/bytes.h"
#include "sim/error.h"
#include "sim/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

// Change it whenever the file's layout, the mesher or what is done with its result changes.
constexpr std::string_view maker = "tetpbd cache 1, TetGen 1.5.0";

struct CacheHeader {
  std::array<char, 8> magic{'t', 'e', 't', 'p', 'b', 'd', 'M', '1'};
  CacheKey key{};
  std::uint64_t checksum = 0;  // of all that follows
  std::uint64_t size = 0;
};

fs::path cache_folder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value ? value : "");
  };
  if (const fs::path own = variable("TETPBD_CACHE"); !own.empty()) return own;
  if (const fs::path shared = variable("XDG_CACHE_HOME"); shared.is_absolute()) return shared / "tetpbd";
  if (const fs::path home = variable("HOME"); !home.empty()) return home / ".cache" / "tetpbd";
  return {};
}

// Damage passes the checksum only by malice, but a cache folder may be shared: what is taken is a mesh.
bool is_sound(const TetMesh& mesh) {
  const auto in_range = [&](const auto& elements) {
    for (const auto& element : elements)
      for (const std::uint32_t v : element)
        if (v >= mesh.positions.size()) return false;
    return true;
  };
  const auto has_volume = [&](const Tet& tet) { return tet_volume(mesh, tet) > 0; };  // false for NaN as well
  return !mesh.tets.empty() && in_range(mesh.tets) && in_range(mesh.surface) &&
         std::all_of(mesh.tets.begin(), mesh.tets.end(), has_volume) &&
         std::all_of(mesh.positions.begin(), mesh.positions.end(),
                     [](const glm::dvec3& p) { return glm::length(p) < largest_coordinate; });
}

}  // namespace

CacheKey cache_key(const SurfaceMesh& surface, const std::string& switches) {
  std::string bytes = fmt::format("{}\n{}\n", maker, switches);
  put_array(bytes, surface.positions);
  put_array(bytes, surface.triangles);
  return {hash_bytes(bytes, 1), hash_bytes(bytes, 2)};
}

fs::path cache_file(const CacheKey& key) {
  const fs::path folder = cache_folder();
  return folder.empty() ? folder : folder / fmt::format("{:016x}{:016x}.tets", key[0], key[1]);
}

std::optional<TetMesh> parse_cache(std::string_view bytes, const CacheKey& key) {
  CacheHeader header;
  if (bytes.size() < sizeof header) return {};
  std::memcpy(&header, bytes.data(), sizeof header);
  bytes.remove_prefix(sizeof header);
  if (header.magic != CacheHeader{}.magic || header.key != key || header.size != bytes.size() ||
      hash_bytes(bytes, 3) != header.checksum)
    return {};
  TetMesh mesh;
  const bool whole = take_array(bytes, mesh.positions) && take_array(bytes, mesh.tets) &&
                     take_array(bytes, mesh.surface) && bytes.empty() && is_sound(mesh);
  if (!whole) return {};
  return mesh;
}

std::string cache_bytes(const CacheKey& key, const TetMesh& mesh) {
  std::string bytes(sizeof(CacheHeader), '\0');
  put_array(bytes, mesh.positions);
  put_array(bytes, mesh.tets);
  put_array(bytes, mesh.surface);
  CacheHeader header;
  header.key = key;
  header.size = bytes.size() - sizeof header;
  header.checksum = hash_bytes(std::string_view(bytes).substr(sizeof header), 3);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

std::optional<TetMesh> read_cache(const CacheKey& key) {
  const fs::path file = cache_file(key);
  std::error_code failed;
  if (!fs::is_regular_file(file, failed)) return {};
  const std::uintmax_t size = fs::file_size(file, failed);
  std::ifstream in(file, std::ios::binary);
  CacheHeader header;  // looked at first: a wrong file is not read whole
  if (failed || !in.read(reinterpret_cast<char*>(&header), sizeof header) ||
      header.size != size - sizeof header)
    return {};
  std::string bytes(size, '\0');
  in.seekg(0);
  if (!in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) return {};
  return parse_cache(bytes, key);
}

void write_cache(const CacheKey& key, const TetMesh& mesh) {
  const fs::path file = cache_file(key);
  if (file.empty()) return;
  std::error_code ignored;
  fs::create_directories(file.parent_path(), ignored);
  try {
    write_files_whole({{file, cache_bytes(key, mesh)}});
  } catch (const Error&) {  // read-only or full: the next run meshes again
  }
}

}  // namespace tetpbd
