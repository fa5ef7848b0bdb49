// Linked programs in the cache folder.
#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>

#include "sim/gl/gpu.h"
#include "sim/layout.h"
#include "sim/gl/program_cache.h"
#include "tests/gl_test.h"
#include "tests/mesh_samples.h"

using namespace tetpbd;
using samples::Folder;
namespace fs = std::filesystem;

namespace {

std::string content(const fs::path& file) { return read_cached(file, 1u << 30).value_or(""); }

std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  if (fs::exists(folder))
    for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

// What the kernel leaves of 1, 2, 3.
std::vector<unsigned> run_keep(const Program& program) {
  const std::vector<unsigned> numbers = {1, 2, 3};
  const Buffer from("from", numbers), to("to", 12), check("check", std::vector<unsigned>{0xffffffffu});
  from.bind_storage(BIND_KEEP_FROM), to.bind_storage(BIND_KEEP_TO), check.bind_storage(BIND_CHECK);
  program.use();
  program.set("count", 3u);
  glDispatchCompute(1, 1, 1);
  return to.read_all<unsigned>();
}

void require_works() { REQUIRE(run_keep(Program::compute("keep.comp")) == std::vector<unsigned>{1, 2, 3}); }

bool driver_gives_binaries() {
  GLint formats = 0;
  glGetIntegerv(GL_NUM_PROGRAM_BINARY_FORMATS, &formats);
  if (formats == 0) MESSAGE("skipped: this driver gives no program binaries");
  return formats > 0;
}

}  // namespace

TEST_CASE("program cache: a program comes back from its file, and works") {
  GlTest gl;
  if (!driver_gives_binaries()) return;
  const Folder folder;
  forget_programs();
  require_works();
  const auto files = files_of(folder.cache() / "programs");
  REQUIRE(files.size() == 1);
  CHECK(files[0].extension() == ".program");
  const std::string bytes = content(files[0]);
  const auto before = fs::file_time_type::clock::now() - std::chrono::hours(1);
  fs::last_write_time(files[0], before);
  forget_programs();
  require_works();
  CHECK(content(files[0]) == bytes);
  CHECK(fs::last_write_time(files[0]) > before);  // used: it is not the oldest any more
  // Other text, other file.
  const Program other = Program::compute("keep.comp", {}, {"OTHER 1"});
  CHECK(files_of(folder.cache() / "programs").size() == 2);
}

TEST_CASE("program cache: damaged, cut, foreign and refused files are compiled anew and rewritten") {
  GlTest gl;
  if (!driver_gives_binaries()) return;
  const Folder folder;
  forget_programs();
  require_works();
  const fs::path file = files_of(folder.cache() / "programs").at(0);
  const std::string bytes = content(file);
  const auto mended = [&](const std::string& damaged) {
    std::ofstream(file, std::ios::binary) << damaged;
    forget_programs();
    require_works();
    CHECK(content(file) == bytes);
  };
  for (const std::size_t place : {std::size_t{0}, std::size_t{9}, std::size_t{27}, std::size_t{35},
                                  std::size_t{41}, bytes.size() / 2, bytes.size() - 1}) {
    CAPTURE(place);
    std::string damaged = bytes;
    damaged[place] = static_cast<char>(damaged[place] ^ 0x10);
    mended(damaged);
  }
  for (const std::size_t size :
       {bytes.size() - 1, std::size_t{44}, std::size_t{40}, std::size_t{3}, std::size_t{0}})
    mended(bytes.substr(0, size));
  mended(bytes + "x");
  // Sound by its checksum, and yet nothing the driver takes.
  CacheKey key{};
  std::memcpy(key.data(), bytes.data() + 8, sizeof key);
  ProgramBinary binary;
  std::memcpy(&binary.format, bytes.data() + 40, sizeof binary.format);
  CHECK(program_bytes(key, {binary.format, bytes.substr(44)}) == bytes);
  mended(program_bytes(key, {binary.format, std::string(500, 'x')}));
  mended(program_bytes(key, {binary.format, bytes.substr(44, 100)}));
  mended(program_bytes(key, {binary.format + 1, bytes.substr(44)}));
  fs::remove(file), fs::create_directory(file);
  forget_programs();
  require_works();
}

TEST_CASE("program cache: a folder that cannot be written is no error") {
  GlTest gl;
  const Folder folder;
  folder.write("file", "in the way");
  for (const std::string& cache :
       {(folder.path / "file").string(), std::string("/proc/none"), std::string("/dev/full")}) {
    ::setenv("TETPBD_CACHE", cache.c_str(), 1);
    forget_programs();
    require_works();
    require_works();
  }
}

TEST_CASE("program cache: the key is of the driver, the kinds of stages and all texts") {
  const CacheKey key = program_key({{GL_VERTEX_SHADER, "a"}, {GL_FRAGMENT_SHADER, "b"}}, "driver\n");
  CHECK(key == program_key({{GL_VERTEX_SHADER, "a"}, {GL_FRAGMENT_SHADER, "b"}}, "driver\n"));
  CHECK(key != program_key({{GL_VERTEX_SHADER, "a"}, {GL_FRAGMENT_SHADER, "b"}}, "driver 2\n"));
  CHECK(key != program_key({{GL_VERTEX_SHADER, "a"}, {GL_GEOMETRY_SHADER, "b"}}, "driver\n"));
  CHECK(key != program_key({{GL_VERTEX_SHADER, "ab"}, {GL_FRAGMENT_SHADER, ""}}, "driver\n"));
  CHECK(key != program_key({{GL_VERTEX_SHADER, "a"}}, "driver\n"));
  const std::string bytes = program_bytes(key, {7, "code"});
  REQUIRE(parse_program(bytes, key, {6, 7}));
  CHECK(parse_program(bytes, key, {6, 7})->bytes == "code");
  CHECK(!parse_program(bytes, key, {6}));
  CHECK(!parse_program(bytes, key, {}));  // a driver that gives no binaries
  CHECK(!parse_program(bytes, {1, 2}, {7}));
  CHECK(!parse_program(program_bytes(key, {7, ""}), key, {7}));
}

TEST_CASE("program cache: the oldest files go beyond the limits") {
  const Folder folder;
  const auto now = fs::file_time_type::clock::now();
  for (int i = 0; i < 8; ++i)
    fs::last_write_time(folder.write(std::to_string(i), std::string(100, 'x')),
                        now - std::chrono::minutes(i));
  const auto left = [&] { return files_of(folder.path).size(); };
  bound_cache(folder.path, 10, 10000);
  CHECK(left() == 8);
  bound_cache(folder.path, 6, 10000);
  CHECK(left() == 6);
  CHECK(!fs::exists(folder.path / "7"));
  bound_cache(folder.path, 10, 350);
  CHECK(left() == 3);
  CHECK(fs::exists(folder.path / "0"));
  CHECK(fs::exists(folder.path / "2"));
  bound_cache(folder.path / "none", 1, 1);
}
