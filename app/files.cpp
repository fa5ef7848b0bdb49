#include "app/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <png.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "sim/error.h"
#include "sim/files.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

std::string npy(const char* type, std::size_t rows, std::size_t columns, const void* data) {
  std::string header =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}, {}), }}", type, rows, columns);
  header.resize((10 + header.size() + 1 + 63) / 64 * 64 - 10 - 1, ' ');
  header += '\n';
  std::string text = "\x93NUMPY\x01";
  text += '\0';
  text += char(header.size() & 255);
  text += char(header.size() >> 8);
  text += header;
  text.append(static_cast<const char*>(data), rows * columns * 4);
  return text;
}

}  // namespace

void make_output_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder))
    throw Error("cannot make the output folder", folder.string(),
                error ? error.message() : "a file is in the way");
  if (access(folder.c_str(), W_OK) != 0)
    throw Error("cannot write to the output folder", folder.string(), std::strerror(errno));
}

GrowingFile::GrowingFile(const fs::path& file)
    : file_(file), temporary_(temporary_name(file)), stream_(temporary_, std::ios::binary) {
  check();
}

GrowingFile::~GrowingFile() {
  if (!stream_.is_open()) return;
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

void GrowingFile::add(const std::string& text) {
  stream_ << text;
  check();
}

void GrowingFile::close() {
  stream_.close();
  check();
  rename_whole(temporary_, file_);
}

void GrowingFile::check() {
  if (stream_) return;
  const std::string why = std::strerror(errno);
  std::error_code ignored;
  fs::remove(temporary_, ignored);
  throw Error("cannot write", file_.string(), why, 1);
}

void write_file(const fs::path& file, const std::string& content) { write_whole(file, content); }

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? "\"\"" : std::string(1, c);
  return field + "\"";
}

void write_png(const fs::path& file, const Image& image) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = png_uint_32(image.width);
  png.height = png_uint_32(image.height);
  png.format = PNG_FORMAT_RGBA;
  png.flags = PNG_IMAGE_FLAG_FAST;
  png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string content(bytes, '\0');
  if (!png_image_write_to_memory(&png, content.data(), &bytes, 0, image.rgba.data(), 0, nullptr))
    throw Error("cannot encode a PNG", file.string(), png.message, 1);
  content.resize(bytes);
  write_file(file, content);
}

void write_npy(const fs::path& file, const std::vector<glm::vec3>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!std::isfinite(rows[i].x) || !std::isfinite(rows[i].y) || !std::isfinite(rows[i].z))
      throw Error("positions are not finite", fmt::format("{}, vertex {}", file.string(), i),
                  "nothing is written", 1);
  write_file(file, npy("<f4", rows.size(), 3, rows.data()));
}
void write_npy(const fs::path& file, const std::vector<Tet>& rows) {
  write_file(file, npy("<u4", rows.size(), 4, rows.data()));
}

// ------------------------------------------------------------------------------------------------------------
// video

Video::Video(const fs::path& file, int width, int height, int frames_per_second)
    : file_(file), temporary_(temporary_name(file)), log_(temporary_.string() + ".log") {
  if (file.extension() != ".mp4" && file.extension() != ".mkv" && file.extension() != ".webm" &&
      file.extension() != ".gif")
    throw Error("unknown video format", file.string(), "name it .mp4, .mkv, .webm or .gif");
  if (width % 2 || height % 2)
    throw Error("video needs an even size", fmt::format("{}x{}", width, height), "change --size");
  signal(SIGPIPE, SIG_IGN);  // a dead ffmpeg is an error of write(), not of ours
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw Error("cannot start ffmpeg", file.string(), std::strerror(errno), 1);
  // Arguments are passed as they are: no shell sees the file name.
  const std::string size = fmt::format("{}x{}", width, height), rate = std::to_string(frames_per_second);
  const std::string target = "file:" + temporary_.string();
  std::vector<const char*> arguments = {"ffmpeg",   "-y",         "-loglevel", "error", "-f",
                                        "rawvideo", "-pix_fmt",   "rgba",      "-s",    size.c_str(),
                                        "-r",       rate.c_str(), "-i",        "-"};
  if (file.extension() != ".gif") arguments.insert(arguments.end(), {"-pix_fmt", "yuv420p"});
  if (file.extension() == ".mp4") arguments.insert(arguments.end(), {"-movflags", "+faststart"});
  arguments.insert(arguments.end(), {target.c_str(), nullptr});
  const std::string log = log_.string();
  child_ = fork();
  if (child_ == 0) {
    setpgid(0, 0);  // Ctrl-C in a terminal is for us: ffmpeg gets its last frames and ends the file
    dup2(ends[0], 0);
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (out >= 0) dup2(out, 1), dup2(out, 2);
    execvp("ffmpeg", const_cast<char* const*>(arguments.data()));
    _exit(127);
  }
  ::close(ends[0]);
  pipe_ = ends[1];
  if (child_ < 0) throw Error("cannot start ffmpeg", file.string(), std::strerror(errno), 1);
}

// Waits for ffmpeg; its exit status, and what it said if it failed.
void Video::finish() {
  if (pipe_ >= 0) ::close(pipe_), pipe_ = -1;
  int status = 0;
  while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
  const bool missing = WIFEXITED(status) && WEXITSTATUS(status) == 127;
  std::string why = missing ? "install ffmpeg" : "ffmpeg ended early";
  std::string line;
  if (std::ifstream log(log_); std::getline(log, line) && !line.empty()) why += " (" + line + ")";
  std::error_code ignored;
  fs::remove(log_, ignored);
  // On a full disk ffmpeg 5.1 says so and still ends with 0.
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0 && line.empty()) return;
  fs::remove(temporary_, ignored);
  throw Error("cannot write the video", file_.string(), why, 1);
}

void Video::add(const Image& frame) {
  const auto* data = frame.rgba.data();
  std::size_t left = frame.rgba.size();
  while (left > 0) {
    const ssize_t sent = write(pipe_, data, left);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) {
      finish();  // throws what ffmpeg said
      throw Error("cannot write the video", file_.string(), "ffmpeg stopped reading", 1);
    }
    data += sent;
    left -= std::size_t(sent);
  }
}

void Video::close() {
  finish();
  rename_whole(temporary_, file_);
}

Video::~Video() {
  if (pipe_ >= 0) ::close(pipe_);
  if (child_ > 0) {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
    std::error_code ignored;
    fs::remove(log_, ignored);
    fs::remove(temporary_, ignored);
  }
}

}  // namespace tetpbd
