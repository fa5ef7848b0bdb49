#include "app/files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <png.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <utility>

#include "sim/error.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

// One word of a shell's command line.
std::string quoted(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

}  // namespace

std::string free_name(const std::string& name, const std::string& ending) {
  for (int i = 0;; ++i)
    if (const auto file = fmt::format("{}_{:03}.{}", name, i, ending); !fs::exists(file)) return file;
}

void make_output_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error && access(folder.c_str(), W_OK) != 0) error.assign(errno, std::generic_category());
  if (error) throw Error("cannot write to the output folder", folder.string(), error.message());
}

void remove_frames(const fs::path& folder, const std::string& ending) {
  std::vector<fs::path> old;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const bool numbered = name.starts_with("frame_") && name.size() > 6 + ending.size() && name.ends_with(ending) &&
                          name.find_first_not_of("0123456789", 6) == name.size() - ending.size();
    if (numbered) old.push_back(entry.path());
  }
  for (const fs::path& file : old) fs::remove(file);
}

void write_png(const fs::path& file, const Image& image) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = png_uint_32(image.width);
  png.height = png_uint_32(image.height);
  png.format = PNG_FORMAT_RGBA;
  png.flags = PNG_IMAGE_FLAG_FAST;
  const PartFile whole(file);
  if (!png_image_write_to_file(&png, whole.part.c_str(), 0, image.rgba.data(), 0, nullptr))
    throw Error("cannot be written", file.string(), png.message, 1);
  whole.finish();
}

std::optional<Image> read_png(const fs::path& file) {
  constexpr png_uint_32 most = 1024;  // pixels a side
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_file(&png, file.c_str())) return {};
  png.format = PNG_FORMAT_RGBA;
  Image image{int(png.width), int(png.height), {}};
  const bool fits = png.width <= most && png.height <= most;
  if (fits) image.rgba.resize(std::size_t(4) * png.width * png.height);
  if (fits && png_image_finish_read(&png, nullptr, image.rgba.data(), 0, nullptr)) return image;
  png_image_free(&png);
  return {};
}

std::string npy_header(bool floats, const std::vector<std::size_t>& shape) {
  return fmt::format("{}{:<117}\n", std::string_view("\x93NUMPY\x01\0\x76\0", 10),
                     fmt::format("{{'descr': '<{}4', 'fortran_order': False, 'shape': ({},), }}", floats ? 'f' : 'u',
                                 fmt::join(shape, ", ")));
}

void write_npy(const fs::path& file, const std::vector<glm::vec3>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!std::isfinite(rows[i].x) || !std::isfinite(rows[i].y) || !std::isfinite(rows[i].z))
      throw Error("positions are not finite", fmt::format("{}, vertex {}", file.string(), i), "nothing is written", 1);
  write_file(file, npy_header(true, {rows.size(), 3}) + bytes_of(rows));
}

Video::Video(const fs::path& file, int width, int height, double frames_per_second)
    : video_(file), log_(file.string() + ".log") {
  const std::string extension = file.extension().string();
  if (extension != ".mp4" && extension != ".mkv" && extension != ".webm" && extension != ".gif")
    throw Error("unknown video format", file.string(), "name it .mp4, .mkv, .webm or .gif");
  if (const fs::path folder = file.parent_path(); !folder.empty() && !fs::is_directory(folder))
    throw Error("no such folder", folder.string(), "make it first", 1);
  std::signal(SIGPIPE, SIG_IGN);  // a dead ffmpeg is an error of writing, not of ours
  // A session of its own: Ctrl-C in a terminal is for us, ffmpeg gets its last frames and ends the file.
  const std::string command = fmt::format(
      "exec setsid ffmpeg -y -loglevel error -f rawvideo -pix_fmt rgba -s {}x{} -r {:.6g} -i - {} {} {} {} >{} "
      "2>&1",
      width, height, frames_per_second,
      width % 2 || height % 2 ? "-vf 'pad=ceil(iw/2)*2:ceil(ih/2)*2'" : "",  // which these formats ask for
      extension == ".gif" ? "" : "-pix_fmt yuv420p", extension == ".mp4" ? "-movflags +faststart" : "",
      quoted("file:" + video_.part.string()), quoted(log_.part.string()));
  pipe_ = ::popen(command.c_str(), "we");
  if (!pipe_) throw Error("cannot start ffmpeg", file.string(), std::strerror(errno), 1);
}

void Video::add(const Image& frame) {
  if (std::fwrite(frame.rgba.data(), 1, frame.rgba.size(), pipe_) < frame.rgba.size()) close();  // says why
}

void Video::close() {
  const bool sent = std::fflush(pipe_) == 0 && !std::ferror(pipe_);
  const int status = ::pclose(std::exchange(pipe_, nullptr));
  std::string said;
  std::getline(std::ifstream(log_.part), said);
  // On a full disk ffmpeg 5.1 says so and still ends with 0.
  if (sent && status == 0 && said.empty()) return video_.finish();
  // What setsid ends with where there is no ffmpeg, or some folder of PATH cannot be read.
  const bool missing = WIFEXITED(status) && (WEXITSTATUS(status) == 127 || WEXITSTATUS(status) == 126);
  throw Error("cannot write the video", video_.file.string(),
              missing ? "install ffmpeg" : "ffmpeg ended early" + (said.empty() ? "" : " (" + said + ")"), 1);
}

Video::~Video() {
  if (pipe_) ::pclose(pipe_);
}

}  // namespace tetpbd
