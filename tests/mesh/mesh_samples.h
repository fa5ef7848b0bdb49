// Small surfaces and a temporary folder for the mesh tests.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "sim/error.h"
#include "sim/mesh/tet_mesh.h"

namespace samples {

namespace fs = std::filesystem;

/// A folder that goes with the test; TETPBD_CACHE points into it while it lives.
struct Folder {
  fs::path path;
  std::string cache_before;
  Folder() {
    std::string name = (fs::temp_directory_path() / "tetpbd_test_XXXXXX").string();
    path = ::mkdtemp(name.data());
    if (const char* cache = std::getenv("TETPBD_CACHE")) cache_before = cache;
    ::setenv("TETPBD_CACHE", (path / "cache").c_str(), 1);
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
    cache_before.empty() ? ::unsetenv("TETPBD_CACHE") : ::setenv("TETPBD_CACHE", cache_before.c_str(), 1);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path write(const std::string& name, const std::string& content) const {
    std::ofstream(path / name, std::ios::binary) << content;
    return path / name;
  }
  fs::path cache() const { return path / "cache"; }
};

/// What the Error says, with its exit status in front ("2 ..."); empty when there is none.
template <class Action>
std::string error_of(const Action& action) {
  try {
    action();
  } catch (const tetpbd::Error& error) {
    return fmt::format("{} {}", error.exit_status, error.what());
  }
  return "";
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// An irregular block about (0, 0, 0), moved: corrections differ from vertex to vertex.
inline tetpbd::TetMesh irregular_block(glm::ivec3 cells, const glm::dvec3& moved) {
  tetpbd::TetMesh mesh = tetpbd::make_block(glm::dvec3(1.0, 0.7, 0.5), cells);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    auto& p = mesh.positions[i];
    p += 0.02 * glm::dvec3(std::sin(12.9 * double(i)), std::sin(78.2 * double(i)), std::sin(37.7 * double(i)));
    p += moved + glm::dvec3(0.15 * p.y * p.y, 0, 0);
  }
  tetpbd::finish_tets(mesh, "block");
  return mesh;
}

inline tetpbd::SurfaceMesh tetrahedron(const glm::dvec3& at = glm::dvec3(0)) {
  return {{at, at + glm::dvec3(1, 0, 0), at + glm::dvec3(0, 1, 0), at + glm::dvec3(0, 0, 1)},
          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

/// Side 1, low corner at `at`, volume 1.
inline tetpbd::SurfaceMesh cube(const glm::dvec3& at = glm::dvec3(0), double side = 1) {
  tetpbd::SurfaceMesh s;
  for (int i = 0; i < 8; ++i) s.positions.push_back(at + side * glm::dvec3(i & 1, (i >> 1) & 1, i >> 2));
  s.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return s;
}

inline tetpbd::SurfaceMesh rectangle(double x, double y, double z = 0) {
  return {{{0, 0, z}, {x, 0, z}, {x, y, z}, {0, y, z}}, {{0, 1, 2}, {0, 2, 3}}};
}
/// n x n on each of the cube's sides, pushed out to a sphere of radius 1.
inline tetpbd::SurfaceMesh sphere(int n) {
  tetpbd::SurfaceMesh s;
  const tetpbd::SurfaceMesh box = cube(glm::dvec3(-1), 2);
  for (std::size_t side = 0; side < 12; side += 2) {
    const tetpbd::Triangle &t = box.triangles[side], &u = box.triangles[side + 1];
    const glm::dvec3 a = box.positions[t[0]], b = box.positions[t[1]], d = box.positions[u[2]];
    const auto base = std::uint32_t(s.positions.size());
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i)
        s.positions.push_back(glm::normalize(a + (b - a) * (double(i) / n) + (d - a) * (double(j) / n)));
    const auto at = [&](int i, int j) { return base + std::uint32_t(j * (n + 1) + i); };
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        s.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        s.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  tetpbd::weld(s, 1e-9);
  return s;
}

inline tetpbd::SurfaceMesh joined(tetpbd::SurfaceMesh a, const tetpbd::SurfaceMesh& b) {
  const auto base = static_cast<std::uint32_t>(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const tetpbd::Triangle& t : b.triangles) a.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  return a;
}

inline double signed_volume(const tetpbd::SurfaceMesh& s) {
  double volume = 0;
  for (const auto& t : s.triangles)
    volume += glm::dot(s.positions[t[0]], glm::cross(s.positions[t[1]], s.positions[t[2]])) / 6;
  return volume;
}

inline std::string ascii_ply(const tetpbd::SurfaceMesh& s) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      s.positions.size(), s.triangles.size());
  for (const auto& p : s.positions) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
  for (const auto& t : s.triangles) text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  return text;
}

}  // namespace samples
