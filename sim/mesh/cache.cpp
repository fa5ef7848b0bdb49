#include "sim/mesh/cache.h"

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/hash.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

// To be changed whenever the file's layout or what is done with TetGen's result changes.
constexpr std::string_view version = "tetpbd cache 4";

std::string mesh_file(std::uint64_t key) { return fmt::format("{:016x}.tets", key); }

}  // namespace

fs::path cache_file(const std::string& name) {
  constexpr std::pair<const char*, const char*> folders[] = {
      {"TETPBD_CACHE", ""}, {"XDG_CACHE_HOME", "tetpbd"}, {"HOME", ".cache/tetpbd"}};
  for (const auto& [variable, below] : folders)
    if (const char* folder = std::getenv(variable); folder && *folder) return fs::path(folder) / below / name;
  return {};
}

std::uint64_t mesh_key(const SurfaceMesh& surface, const std::string& switches, const fs::path& program) {
  std::error_code failed;  // a program that is not there gives a size and time that no file has
  const auto size = fs::file_size(program, failed);
  const auto written = fs::last_write_time(program, failed).time_since_epoch().count();
  std::string bytes = fmt::format("{}\n{}\n{} {}\n", version, switches, size, written);
  put_array(bytes, surface.positions);
  put_array(bytes, surface.triangles);
  return hash_bytes(bytes);
}

void seal(std::string& bytes, std::uint64_t key) { put_array(bytes, std::vector{hash_bytes(bytes, key)}); }

bool unseal(std::string_view& bytes, std::uint64_t key) {
  constexpr std::size_t seal_size = 16;  // an array of one
  if (bytes.size() < seal_size) return false;
  std::string_view end = bytes.substr(bytes.size() - seal_size);
  bytes.remove_suffix(seal_size);
  std::vector<std::uint64_t> sum;
  return take_array(end, sum) && sum == std::vector{hash_bytes(bytes, key)};
}

std::optional<TetMesh> parse_mesh(std::string_view bytes, std::uint64_t key) try {
  TetMesh mesh;
  if (!take_sealed(bytes, key, mesh.positions, mesh.tets)) return {};
  finish_tets(mesh, "cache");
  return mesh;
} catch (const Error&) {  // passes the checksum only by malice, but a cache folder may be shared
  return {};
}

std::string read_cached(const std::string& name) {
  const fs::path file = cache_file(name);
  std::error_code failed;
  const std::uintmax_t size = fs::file_size(file, failed);  // fails unless it is a plain file
  if (failed) return {};
  std::string bytes(size, '\0');
  std::ifstream(file, std::ios::binary).read(bytes.data(), std::streamsize(bytes.size()));
  return bytes;
}

void keep_cached(const std::string& name, std::string bytes, std::uint64_t key) try {
  const fs::path file = cache_file(name);
  if (file.empty()) return;
  fs::create_directories(file.parent_path());
  seal(bytes, key);
  write_file(file, bytes);
} catch (const std::exception&) {  // read-only or full
}

std::optional<TetMesh> read_mesh(std::uint64_t key) { return parse_mesh(read_cached(mesh_file(key)), key); }

void keep_mesh(std::uint64_t key, const TetMesh& mesh) { keep_cached(mesh_file(key), key, mesh.positions, mesh.tets); }

}  // namespace tetpbd
