// A body, a target and a camera, and ways to ask what an image shows; for the tests of render/.
#pragma once

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "render/renderer.h"
#include "render/target.h"
#include "sim/gl/context.h"
#include "sim/gl/layout.h"

namespace tetpbd {

inline constexpr int width = 240, height = 180;

// Where a point appears, in pixels from the top left; z: depth -1..1, outside that range not in view.
inline glm::vec3 project(const Camera& camera, const glm::vec3& point, int width, int height) {
  const glm::vec4 clip =
      projection_matrix(camera, float(width) / float(height)) * view_matrix(camera) * glm::vec4(point, 1.0f);
  return {(clip.x / clip.w * 0.5f + 0.5f) * float(width), (0.5f - clip.y / clip.w * 0.5f) * float(height),
          clip.z / clip.w};
}

// A block of cells, each cut into the six tets around its diagonal, and its boundary.
inline TetMesh cut_block(const glm::dvec3& size, int n, const glm::dvec3& centre = glm::dvec3(0.0)) {
  TetMesh mesh;
  const auto index = [&](const glm::ivec3& c) { return std::uint32_t((c.z * (n + 1) + c.y) * (n + 1) + c.x); };
  for (int z = 0; z <= n; ++z)
    for (int y = 0; y <= n; ++y)
      for (int x = 0; x <= n; ++x) mesh.positions.push_back(centre + size * (glm::dvec3(x, y, z) / double(n) - 0.5));
  const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  for (int cell = 0; cell < n * n * n; ++cell)
    for (int k = 0; k < 6; ++k) {
      glm::ivec3 c{cell % n, cell / n % n, cell / n / n};
      Tet tet{index(c)};
      for (std::size_t i = 0; i < 3; ++i) ++c[orders[k][i]], tet[i + 1] = index(c);
      if (k >= 3) std::swap(tet[2], tet[3]);
      mesh.tets.push_back(tet);
    }
  std::map<Triangle, Triangle> faces;
  for (const auto& [a, b, c, d] : mesh.tets)
    for (const Triangle& face : {Triangle{a, c, b}, Triangle{a, b, d}, Triangle{a, d, c}, Triangle{b, c, d}}) {
      Triangle key = face;
      std::sort(key.begin(), key.end());
      if (!faces.emplace(key, face).second) faces.erase(key);
    }
  for (const auto& [key, face] : faces) mesh.surface.push_back(face);
  return mesh;
}

inline std::vector<Position> positions_of(const TetMesh& mesh, double scale = 1.0,
                                          const glm::dvec3& shift = glm::dvec3(0.0)) {
  std::vector<Position> positions;
  for (const glm::dvec3& p : mesh.positions) {
    Position position{};
    position.high = glm::vec3(p * scale + shift);
    position.low = glm::vec3(p * scale + shift - glm::dvec3(position.high));
    positions.push_back(position);
  }
  return positions;
}

// One body, a target and a frame that looks at it.
struct Stage {
  HeadlessContext context{-1, true};
  TetMesh mesh;
  Buffer positions;
  Renderer renderer;
  Target target;
  Frame frame;
  explicit Stage(TetMesh body = cut_block(glm::dvec3(1.0), 3), int samples = 0) : mesh(std::move(body)) {
    positions = Buffer("positions", positions_of(mesh));
    renderer = make_renderer(mesh);
    target = make_target(width, height, samples);
    frame.positions = positions.id();
    frame.viewport = {0, 0, width, height};
    frame.target = target.framebuffer.id();
    frame.camera.distance = 4;
    frame.options.shadow = false;
  }
  void move(double scale, const glm::dvec3& shift = glm::dvec3(0.0)) {
    const auto moved = positions_of(mesh, scale, shift);
    positions.write(0, moved.size() * sizeof(Position), moved.data());
  }
  Image image() {
    draw(renderer, frame);
    return read_rgba(target);
  }
  // The same without the body: every vertex is dropped.
  Image empty() {
    const auto kept = positions.read_all<Position>();
    auto gone = kept;
    for (Position& p : gone) p.high = glm::vec3(std::numeric_limits<float>::quiet_NaN());
    positions.write(0, positions.bytes(), gone.data());
    Image result = image();
    positions.write(0, positions.bytes(), kept.data());
    return result;
  }
};

inline glm::vec3 pixel(const Image& image, int x, int y) {
  const std::size_t i = (std::size_t(y) * std::size_t(image.width) + std::size_t(x)) * 4;
  return {float(image.rgba[i]), float(image.rgba[i + 1]), float(image.rgba[i + 2])};
}

inline glm::vec3 pixel(const Image& image, const glm::vec3& at) { return pixel(image, int(at.x), int(at.y)); }

inline float brightness(const glm::vec3& colour) { return (colour.x + colour.y + colour.z) / 3.0f; }

// Bounds of, and number of, the pixels in which two images differ by more than `least` of 255.
struct Difference {
  int count = 0;
  glm::ivec2 low{1 << 20}, high{-1};
};
inline Difference difference(const Image& a, const Image& b, float least = 6) {
  Difference result;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      const glm::vec3 d = glm::abs(pixel(a, x, y) - pixel(b, x, y));
      if (std::max({d.x, d.y, d.z}) < least) continue;
      ++result.count;
      result.low = glm::min(result.low, glm::ivec2(x, y));
      result.high = glm::max(result.high, glm::ivec2(x, y));
    }
  return result;
}

}  // namespace tetpbd
