// Files of the app: text (sim/files.h), images, arrays, videos; whole or not there.
#pragma once

#include <cstdio>
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/target.h"
#include "sim/files.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Makes the folder and checks that it can be written to.
void make_output_folder(const std::filesystem::path& folder);
/// Removes frame_NUMBER with this ending, which an earlier run left there and which would be taken for this one's.
void remove_frames(const std::filesystem::path& folder, const std::string& ending);
/// JSON text; bytes that are no UTF-8 (file names may hold any) are replaced.
template <class Json>
std::string json_text(const Json& document, int indent) {
  return document.dump(indent, ' ', false, Json::error_handler_t::replace);
}
template <class Json>
std::vector<std::string> keys(const Json& object) {
  std::vector<std::string> names;
  for (const auto& item : object.items()) names.push_back(item.key());
  return names;
}
/// "NAME_000.ENDING", or the next number that no file in the current folder has.
std::string free_name(const std::string& name, const std::string& ending);
void write_png(const std::filesystem::path& file, const Image& image);
/// A small one; none where there is no such picture.
std::optional<Image> read_png(const std::filesystem::path& file);
template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
/// What a numpy array of float32 (else uint32) begins with: as long for every shape.
std::string npy_header(bool floats, const std::vector<std::size_t>& shape);
/// A numpy array of float32, N x 3; throws Error for numbers that are not finite.
void write_npy(const std::filesystem::path& file, const std::vector<glm::vec3>& rows);
/// Of uint32: N; T x 4, ...
template <class Row>
void write_npy(const std::filesystem::path& file, const std::vector<Row>& rows) {
  std::vector<std::size_t> shape{rows.size()};
  if (sizeof(Row) > 4) shape.push_back(sizeof(Row) / 4);
  write_file(file, npy_header(false, shape) + bytes_of(rows));
}

/// Frames piped into ffmpeg; the file appears when close() has succeeded.
class Video {
 public:
  Video(const std::filesystem::path& file, int width, int height, double frames_per_second);
  ~Video();
  void add(const Image& frame);
  void close();

 private:
  PartFile video_, log_;
  std::FILE* pipe_ = nullptr;
};

}  // namespace tetpbd
