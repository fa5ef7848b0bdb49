#include "tests/fuzz/readers.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "app/commands.h"
#include "app/window/preferences.h"
#include "app/window/record.h"
#include "app/scene.h"
#include "sim/error.h"
#include "sim/hash.h"
#include "sim/mesh/cache.h"
#include "sim/mesh/tet_mesh.h"

namespace fuzz {
namespace {

namespace fs = std::filesystem;
using namespace tetpbd;

[[noreturn]] void broken(const std::string& promise) {
  fmt::print(stderr, "broken promise: {}\n", promise);
  std::abort();
}

void require(bool kept, const char* promise) {
  if (!kept) broken(promise);
}

/// Files live in memory where there is a place for that.
struct Folder {
  fs::path path = fs::is_directory("/dev/shm") ? "/dev/shm" : fs::temp_directory_path();
  Folder() {
    path /= fmt::format("tetpbd_fuzz_{}", ::getpid());
    fs::create_directories(path);
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

fs::path write(const char* name, std::string_view bytes) {
  static const Folder folder;
  const fs::path file = folder.path / name;
  const int target = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (target < 0 || ::write(target, bytes.data(), bytes.size()) != ssize_t(bytes.size()))
    broken("a file in " + folder.path.string());
  ::close(target);
  return file;
}

template <class Work>
void expect_errors_only(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    const std::string text = error.what();
    const std::size_t where = text.find(": ");
    if (where == 0 || where == std::string::npos || text.find(": ", where + 2) == std::string::npos)
      broken(fmt::format("an error names what, where and the mend, not '{}'", text));
    require(printable(text) == text && text.size() < 3100, "an error is one line");
    require(error.exit_status == 1 || error.exit_status == 2, "the exit status is 1 or 2");
  } catch (const std::exception& error) {
    broken(fmt::format("only Error is thrown, not '{}'", error.what()));
  }
}

void require_finite(const std::vector<glm::dvec3>& positions) {
  for (const glm::dvec3& p : positions) require(std::isfinite(p.x + p.y + p.z), "positions are finite");
}

void require_sound(const TetMesh& mesh) {
  require_finite(mesh.positions);
  require(!mesh.tets.empty(), "a mesh has tets");
  for (const Tet& tet : mesh.tets) {
    for (const std::uint32_t v : tet) require(v < mesh.positions.size(), "indices are in range");
    require(tet_volume(mesh, tet) > 0, "volumes are positive");
  }
  for (const Triangle& t : mesh.surface)
    for (const std::uint32_t v : t) require(v < mesh.positions.size(), "indices are in range");
  report(mesh);
}

// The two files of a pair in one: "#ELE" stands between them.
void read_node(std::string_view bytes) {
  const std::size_t middle = std::min(bytes.find("#ELE"), bytes.size());
  const fs::path file = write("pair.node", bytes.substr(0, middle));
  write("pair.ele", bytes.substr(middle));
  expect_errors_only([&] { require_sound(load_tets(file)); });
}

template <const auto& extension>
void read_grid(std::string_view bytes) {
  const fs::path file = write(extension, bytes);
  expect_errors_only([&] { require_sound(load_tets(file)); });
}

void check(SurfaceMesh surface) {
  const SurfaceMesh before = surface;
  const SurfaceCheck check = check_surface(surface);
  require(surface.positions.size() == before.positions.size() && surface.triangles.size() == before.triangles.size(),
          "a check keeps what is there");
  require(before.positions.empty() ||
              std::memcmp(surface.positions.data(), before.positions.data(), 24 * before.positions.size()) == 0,
          "a check only turns triangles");
  if (!check.defect.empty()) return;
  require_finite(surface.positions);
  require(check.volume > 0 && std::isfinite(check.volume), "a sound surface encloses a volume");
  require(check_surface(surface).flipped_triangles == 0, "turned once is turned for good");
}

template <const auto& extension>
void read_surface(std::string_view bytes) {
  const fs::path file = write(extension, bytes);
  expect_errors_only([&] { check(load_surface(file)); });
}

constexpr char ply[] = "mesh.ply", obj[] = "mesh.obj", stl[] = "mesh.stl", off[] = "mesh.off", msh[] = "mesh.msh",
               vtk[] = "mesh.vtk", vtu[] = "mesh.vtu", medit[] = "mesh.mesh";

template <class T>
T take(std::string_view& bytes) {
  T value{};
  const std::size_t n = std::min(sizeof value, bytes.size());
  std::memcpy(&value, bytes.data(), n);
  bytes.remove_prefix(n);
  return value;
}

// A count of vertices (a byte), three floats each, then triples of bytes as triangles: what a reader could
// hand on.
SurfaceMesh surface_of(std::string_view bytes) {
  SurfaceMesh surface;
  const std::size_t vertices = take<std::uint8_t>(bytes);
  for (std::size_t v = 0; v < vertices; ++v) {
    const float x = take<float>(bytes), y = take<float>(bytes), z = take<float>(bytes);
    surface.positions.emplace_back(x, y, z);
  }
  while (bytes.size() >= 3) {
    Triangle t;
    for (std::uint32_t& v : t) v = take<std::uint8_t>(bytes);
    surface.triangles.push_back(t);
  }
  return surface;
}

void read_triangles(std::string_view bytes) {
  const SurfaceMesh surface = surface_of(bytes);
  check(surface);
  SurfaceMesh welded = surface;
  for (const Triangle& t : welded.triangles)
    for (const std::uint32_t v : t)
      if (v >= welded.positions.size()) return;  // weld() asks for indices in range
  weld(welded, 1e-7 * bounds(welded.positions).size());
  for (const Triangle& t : welded.triangles)
    for (const std::uint32_t v : t) require(v < welded.positions.size(), "welding keeps indices in range");
  check(welded);
}

/// The same bytes with doubles and four corners.
void read_tets(std::string_view bytes) {
  TetMesh mesh;
  const std::size_t vertices = take<std::uint8_t>(bytes);
  for (std::size_t v = 0; v < vertices; ++v) {
    const double x = take<double>(bytes), y = take<double>(bytes), z = take<double>(bytes);
    mesh.positions.emplace_back(x, y, z);
  }
  while (bytes.size() >= 4) {
    Tet t;
    for (std::uint32_t& v : t) v = take<std::uint8_t>(bytes);
    mesh.tets.push_back(t);
  }
  expect_errors_only([&] {
    finish_tets(mesh, "fuzz");
    require_sound(mesh);
  });
}

// The whole chain with TetGen.
void fill_surface(std::string_view bytes) {
  ::setenv("TETPBD_CACHE", "/dev/null/none", 1);
  expect_errors_only([&] {
    SurfaceMesh surface = surface_of(bytes);
    if (!check_surface(surface).defect.empty()) return;
    const TetMesh mesh = tetrahedralise(surface, "pYq1.85o/140", 5, "fuzz");
    require_sound(mesh);
  });
}

// As they are, and once more behind a checksum that fits them.
void read_cache_file(std::string_view bytes) {
  constexpr std::uint64_t key = 1;
  if (const auto mesh = parse_mesh(bytes, key)) require_sound(*mesh);
  std::string sealed(bytes);
  seal(sealed, key);
  if (const auto mesh = parse_mesh(sealed, key)) require_sound(*mesh);
}

// Scenes of blocks are built too, where they are small.
void build_if_small(const Scene& scene) {
  std::size_t cells = 0;
  for (const BodyDescription& body : scene.bodies) {
    if (!body.block) return;
    cells += std::size_t(body.block->cells.x) * std::size_t(body.block->cells.y) * std::size_t(body.block->cells.z);
  }
  if (cells > 100) return;
  const auto model = build_model(scene);
  require(model->masses.size() == model->positions.size(), "every vertex has a mass");
  require_finite(model->positions);
  require_finite(model->velocities);
  for (const double mass : model->masses) require(mass > 0, "masses are positive");
}

void read_scene(std::string_view bytes) {
  const fs::path file = write("scene.json", bytes);
  expect_errors_only([&] { build_if_small(load_scene(file.string())); });
}

constexpr std::string_view small_scene =
    R"({"bodies": [{"block": {"size": [1, 1, 1], "cells": [2, 1, 1]}, "fixed": [{"low": [0, 0, 0], "high": [0, 1, 1]}]}],
"world": {"obstacles": [{"point": [0, 0, 0], "normal": [0, 1, 0]}]}, "solver": {"dt": 0.01}})";

std::vector<std::string> lines(std::string_view bytes) {
  std::vector<std::string> parts;
  while (!bytes.empty()) {
    const std::size_t end = std::min(bytes.find('\n'), bytes.size());
    parts.emplace_back(bytes.substr(0, end));
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
  }
  return parts;
}

// A line for --deform, one for --tetgen, then lines for --set.
void read_overrides(std::string_view bytes) {
  static const fs::path file = write("small.json", small_scene);
  expect_errors_only([&] {
    SceneOverrides overrides;
    overrides.set = lines(bytes);
    if (overrides.set.size() < 2) return;
    overrides.deform = overrides.set[0];
    checked_switches(overrides.set[1]);
    overrides.set.erase(overrides.set.begin(), overrides.set.begin() + 2);
    build_if_small(load_scene(file.string(), overrides));
  });
}

void read_record_file(std::string_view bytes) {
  const fs::path file = write("session.jsonl", bytes);
  expect_errors_only([&] {
    for (const RecordLine& line : read_record(file)) line.json.dump();
  });
}

void read_preferences_file(std::string_view bytes) {
  const fs::path file = write("window.json", bytes);
  expect_errors_only([&] {
    const Preferences read = read_preferences(file);
    require(read.panel >= least_panel && read.panel <= most_panel, "a panel that can be used");
    require(read.text >= least_text && read.text <= most_text, "text that can be read");
  });
}

// A word a line. What the words ask for is checked, not done.
void read_words(std::string_view bytes) {
  static const fs::path file = write("words.json", small_scene);
  ::setenv("TETPBD_MODELS", file.parent_path().c_str(), 1);
  expect_errors_only([&] {
    std::vector<std::string> words = lines(bytes);
    for (std::string& word : words)
      if (word == "SCENE") word = file.string();
    parse_command_line(words);
  });
}

}  // namespace

const std::vector<Reader>& readers() {
  static const std::vector<Reader> rows = {
      {"ply", "ply", read_surface<ply>, false},
      {"obj", "obj", read_surface<obj>, false},
      {"stl", "stl", read_surface<stl>, false},
      {"off", "off", read_surface<off>, false},
      {"triangles", "triangles", read_triangles, false},
      {"tets", "tets", read_tets, false},
      {"fill", "fill", fill_surface, true},
      {"node", "node", read_node, false},
      {"msh", "msh", read_grid<msh>, false},
      {"vtk", "vtk", read_grid<vtk>, false},
      {"vtu", "vtu", read_grid<vtu>, false},
      {"medit", "medit", read_grid<medit>, false},
      {"cache", "cache", read_cache_file, false},
      {"scene", "scene", read_scene, false},
      {"overrides", "overrides", read_overrides, false},
      {"words", "words", read_words, false},
      {"record", "record", read_record_file, false},
      {"preferences", "preferences", read_preferences_file, false},
  };
  return rows;
}

}  // namespace fuzz
