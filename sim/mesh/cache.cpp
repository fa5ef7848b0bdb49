#include "sim/mesh/cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "sim/files.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

// Change it whenever the file's layout, the mesher or what is done with its result changes.
constexpr std::string_view maker = "tetpbd cache 1, TetGen 1.5.0";
constexpr std::array<char, 8> magic{'t', 'e', 't', 'p', 'b', 'd', 'M', '1'};

struct Head {
  std::array<char, 8> magic;
  CacheKey key;
  std::uint64_t checksum, size;  // of what follows
};

template <class T>
void put_array(std::string& bytes, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

// Takes an array off the front; false when `bytes` is too short for the count it declares.
template <class T>
bool take_array(std::string_view& bytes, std::vector<T>& values) {
  std::uint64_t count = 0;
  if (bytes.size() < sizeof count) return false;
  std::memcpy(&count, bytes.data(), sizeof count);
  bytes.remove_prefix(sizeof count);
  if (count > bytes.size() / sizeof(T)) return false;
  values.resize(count);
  if (count > 0) std::memcpy(static_cast<void*>(values.data()), bytes.data(), count * sizeof(T));
  bytes.remove_prefix(count * sizeof(T));
  return true;
}

// Damage passes the checksum only by malice, but a cache folder may be shared: what is taken is a mesh.
bool is_sound(const TetMesh& mesh) {
  const auto in_range = [&](const auto& element) {
    return std::ranges::all_of(element, [&](std::uint32_t v) { return v < mesh.positions.size(); });
  };
  return !mesh.tets.empty() && std::ranges::all_of(mesh.tets, in_range) &&
         std::ranges::all_of(mesh.surface, in_range) &&
         std::ranges::all_of(mesh.positions, [](auto& p) { return glm::length(p) < largest_coordinate; }) &&
         std::ranges::all_of(mesh.tets, [&](const Tet& t) { return tet_volume(mesh, t) > 0; });
}

fs::path mesh_file(const CacheKey& key) {
  const fs::path folder = cache_folder();
  return folder.empty() ? folder : folder / fmt::format("{:016x}{:016x}.tets", key[0], key[1]);
}

}  // namespace

std::uint64_t hash_bytes(std::string_view bytes, std::uint64_t seed) {
  std::uint64_t hash = seed ^ (bytes.size() * 0x9e3779b97f4a7c15);
  const auto mix = [&hash](std::uint64_t word) {
    hash = (hash ^ word) * 0xff51afd7ed558ccd;
    hash ^= hash >> 32;
  };
  while (!bytes.empty()) {
    std::uint64_t word = 0;
    const std::size_t n = std::min(bytes.size(), sizeof word);
    std::memcpy(&word, bytes.data(), n);
    mix(word);
    bytes.remove_prefix(n);
  }
  mix(0xc4ceb9fe1a85ec53);
  return hash;
}

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

CacheKey mesh_key(const SurfaceMesh& surface, const std::string& switches) {
  std::string bytes = fmt::format("{}\n{}\n", maker, switches);
  put_array(bytes, surface.positions);
  put_array(bytes, surface.triangles);
  return {hash_bytes(bytes, 1), hash_bytes(bytes, 2)};
}

std::optional<TetMesh> parse_mesh(std::string_view bytes, const CacheKey& key) {
  Head head;
  if (bytes.size() < sizeof head) return {};
  std::memcpy(&head, bytes.data(), sizeof head);
  bytes.remove_prefix(sizeof head);
  TetMesh mesh;
  const bool whole = head.magic == magic && head.key == key && head.size == bytes.size() &&
                     head.checksum == hash_bytes(bytes, 3) && take_array(bytes, mesh.positions) &&
                     take_array(bytes, mesh.tets) && take_array(bytes, mesh.surface) && bytes.empty() &&
                     is_sound(mesh);
  if (!whole) return {};
  return mesh;
}

std::string mesh_bytes(const CacheKey& key, const TetMesh& mesh) {
  std::string content;
  put_array(content, mesh.positions);
  put_array(content, mesh.tets);
  put_array(content, mesh.surface);
  const Head head{magic, key, hash_bytes(content, 3), content.size()};
  return std::string(reinterpret_cast<const char*>(&head), sizeof head) + content;
}

std::optional<TetMesh> read_mesh(const CacheKey& key) {
  const fs::path file = mesh_file(key);
  std::error_code failed;
  const std::uintmax_t size = fs::file_size(file, failed);  // fails for what is no plain file
  if (failed || size > std::uintmax_t{16} << 30) return {};
  std::string bytes(size, '\0');
  if (!std::ifstream(file, std::ios::binary).read(bytes.data(), std::streamsize(size))) return {};
  return parse_mesh(bytes, key);
}

void keep_mesh(const CacheKey& key, const TetMesh& mesh) try {
  const fs::path file = mesh_file(key);
  if (file.empty()) return;
  fs::create_directories(file.parent_path());
  write_whole(file, mesh_bytes(key, mesh));
} catch (const std::exception&) {  // read-only or full
}

}  // namespace tetpbd
