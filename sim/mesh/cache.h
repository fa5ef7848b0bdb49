// The user's cache folder, for what takes long to make: TetGen's meshes, mode newton's aggregates. A file that cannot
// be read or written costs time, but is no error.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// A path in $TETPBD_CACHE, else $XDG_CACHE_HOME/tetpbd, else ~/.cache/tetpbd; empty where none of these is set.
std::filesystem::path cache_file(const std::string& name);

/// Appends an array: its count, then its bits.
template <class T>
void put_array(std::string& bytes, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// Removes an array from the front; false if `bytes` is too short for the count it declares.
template <class T>
bool take_array(std::string_view& bytes, std::vector<T>& values) {
  std::uint64_t count = 0;
  if (bytes.size() < sizeof count) return false;
  std::memcpy(&count, bytes.data(), sizeof count);
  bytes.remove_prefix(sizeof count);
  if (count > bytes.size() / sizeof(T)) return false;
  values.resize(count);
  std::ranges::copy(bytes.substr(0, count * sizeof(T)), reinterpret_cast<char*>(values.data()));
  bytes.remove_prefix(count * sizeof(T));
  return true;
}

/// Appends a checksum of all bytes and `key`; unseal() removes it, and returns false where it does not match.
void seal(std::string& bytes, std::uint64_t key);
bool unseal(std::string_view& bytes, std::uint64_t key);
/// Reads arrays and the seal behind them; false unless `bytes` has exactly these.
template <class... T>
bool take_sealed(std::string_view bytes, std::uint64_t key, std::vector<T>&... arrays) {
  return unseal(bytes, key) && (take_array(bytes, arrays) && ...) && bytes.empty();
}
/// The bytes of a file of the folder; empty if there is none.
std::string read_cached(const std::string& name);
/// Writes a file of the folder, with a seal.
void keep_cached(const std::string& name, std::string bytes, std::uint64_t key);
template <class... T>
void keep_cached(const std::string& name, std::uint64_t key, const std::vector<T>&... arrays) {
  std::string bytes;
  (put_array(bytes, arrays), ...);
  keep_cached(name, std::move(bytes), key);
}

/// Depends on the surface's bits, the switches and the program that fills it.
std::uint64_t mesh_key(const SurfaceMesh& surface, const std::string& switches, const std::filesystem::path& program);
/// Nothing if the mesh is not there, damaged, cut short or of another key.
std::optional<TetMesh> read_mesh(std::uint64_t key);
void keep_mesh(std::uint64_t key, const TetMesh& mesh);
/// The same from a file's bytes.
std::optional<TetMesh> parse_mesh(std::string_view bytes, std::uint64_t key);

}  // namespace tetpbd
