#include "sim/contact/obstacle_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "sim/parallel.h"

namespace tetpbd {

namespace {

void add_triangle(Corners& all, ObstacleCorner a, ObstacleCorner b, const ObstacleCorner& c) {
  const glm::vec3 area = glm::cross(b.position - a.position, c.position - a.position);
  if (glm::length(area) == 0) return;
  if (glm::dot(area, a.normal + b.normal + c.normal) < 0) std::swap(a, b);
  all.insert(all.end(), {a, b, c});
}

// The heights with walls around them, closed by no bottom.
SurfaceMesh height_block(const Obstacle& o) {
  const glm::ivec3 size = o.field->size;
  SurfaceMesh block;
  const auto add_vertex = [&](int i, int k, bool top) {
    const double y = top ? double(o.field->values[std::size_t(i + size.x * k)]) : -o.half.y;
    block.positions.emplace_back(o.half.x * (2.0 * i / (size.x - 1) - 1), y, o.half.z * (2.0 * k / (size.z - 1) - 1));
  };
  for (int k = 0; k < size.z; ++k)
    for (int i = 0; i < size.x; ++i) add_vertex(i, k, true);
  const auto quad = [&](int a, int b, int c, int d) {
    block.triangles.push_back({std::uint32_t(a), std::uint32_t(b), std::uint32_t(c)});
    block.triangles.push_back({std::uint32_t(a), std::uint32_t(c), std::uint32_t(d)});
  };
  for (int k = 0; k + 1 < size.z; ++k)
    for (int i = 0; i + 1 < size.x; ++i) {
      const int p = i + size.x * k;
      quad(p, p + size.x, p + size.x + 1, p + 1);
    }
  std::vector<glm::ivec2> rim;  // counter-clockwise seen from above
  for (int k = 0; k + 1 < size.z; ++k) rim.emplace_back(0, k);
  for (int i = 0; i + 1 < size.x; ++i) rim.emplace_back(i, size.z - 1);
  for (int k = size.z - 1; k > 0; --k) rim.emplace_back(size.x - 1, k);
  for (int i = size.x - 1; i > 0; --i) rim.emplace_back(i, 0);
  const int below = int(block.positions.size()), count = int(rim.size());
  for (const glm::ivec2& p : rim) add_vertex(p.x, p.y, false);
  const auto above = [&](int r) { return rim[std::size_t(r)].x + size.x * rim[std::size_t(r)].y; };
  for (int r = 0; r < count; ++r) {
    const int next = (r + 1) % count;
    quad(above(r), below + r, below + next, above(next));
  }
  return block;
}

// Marching tetrahedra: a grid's cubes are cut into six tets about a diagonal, and crossings moved onto the surface.
Corners contour(const Obstacle& o) {
  constexpr int cells = 28;
  const glm::dvec3 low = -1.1 * o.kind->half(o), step = 2.2 * o.kind->half(o) / double(cells);
  Formulas<double> formulas{o.field ? o.field->values.data() : nullptr, o.kind->distance};
  const auto solid = describe_solid(o);
  const auto place = [&](const glm::ivec3& at) { return low + step * glm::dvec3(at); };
  std::vector<double> distances;
  for (int z = 0; z <= cells; ++z)
    for (int y = 0; y <= cells; ++y)
      for (int x = 0; x <= cells; ++x) distances.push_back(formulas.surface_of(solid, place({x, y, z})).distance);
  const auto distance = [&](const glm::ivec3& at) {
    return distances[std::size_t(at.x + (cells + 1) * (at.y + (cells + 1) * at.z))];
  };
  const auto crossing = [&](const glm::ivec3& a, const glm::ivec3& b) {
    glm::dvec3 p = glm::mix(place(a), place(b), distance(a) / (distance(a) - distance(b)));
    auto surface = formulas.surface_of(solid, p);
    for (int turn = 0; turn < 4; ++turn)
      p -= surface.distance * surface.normal, surface = formulas.surface_of(solid, p);
    return ObstacleCorner{glm::vec3(p), glm::vec3(surface.normal)};
  };
  Corners all;
  const auto cut = [&](const std::array<glm::ivec3, 4>& tet) {
    std::vector<glm::ivec3> in, out;
    for (const glm::ivec3& at : tet) (distance(at) < 0 ? in : out).push_back(at);
    Corners rim;  // three crossings, or four of which the first and last, and the middle two, are not neighbours
    for (const glm::ivec3& a : in)
      for (const glm::ivec3& b : out) rim.push_back(crossing(a, b));
    if (rim.size() >= 3) add_triangle(all, rim[0], rim[1], rim[2]);
    if (rim.size() == 4) add_triangle(all, rim[1], rim[2], rim[3]);
  };
  for (int cube = 0; cube < cells * cells * cells; ++cube)
    for (int first = 0; first < 3; ++first)
      for (int second = 0; second < 3; ++second) {
        if (first == second) continue;
        const glm::ivec3 low_corner(cube % cells, cube / cells % cells, cube / cells / cells);
        glm::ivec3 a = low_corner, b;
        ++a[first], b = a, ++b[second];
        cut({low_corner, a, b, low_corner + 1});
      }
  return all;
}

}  // namespace

Corners rounded(const glm::vec3& half, float disk, float round) {
  const int around = disk > 0 || half.x == 0 ? 16 : 3, up = half.x > 0 || disk > 0 ? 3 : 16;  // a quarter
  std::vector<Corners> rows;
  for (int side = -1; side <= 1; side += 2)
    for (int i = 0; i <= up; ++i) {
      const float rise = float(side < 0 ? i - up : i) / float(up) * 0.5f * std::numbers::pi_v<float>;
      Corners& row = rows.emplace_back();
      for (int quarter = 0; quarter < 4; ++quarter)
        for (int k = 0; k <= around; ++k) {
          const float turn = (float(quarter) + float(k) / float(around)) * 0.5f * std::numbers::pi_v<float>;
          const glm::vec3 away(std::cos(turn), 0, std::sin(turn)),
              normal = std::cos(rise) * away + glm::vec3(0, std::sin(rise), 0);
          const glm::vec3 corner(quarter == 0 || quarter == 3 ? 1 : -1, side, quarter < 2 ? 1 : -1);
          row.push_back({half * corner + disk * away + round * normal, normal});
        }
    }
  Corners all;
  const std::size_t count = rows[0].size();
  for (std::size_t j = 0; j < count; ++j) {
    const std::size_t next = (j + 1) % count;
    for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
      add_triangle(all, rows[i][j], rows[i][next], rows[i + 1][j]);
      add_triangle(all, rows[i][next], rows[i + 1][next], rows[i + 1][j]);
    }
    for (const auto* end : {&rows.front(), &rows.back()}) {
      const glm::vec3 axis(0, (*end)[0].normal.y < 0 ? -1 : 1, 0);
      add_triangle(all, {axis * (half.y + round), axis}, {(*end)[j].position, axis}, {(*end)[next].position, axis});
    }
  }
  return all;
}

Corners smoothed(const SurfaceMesh& surface) {
  std::vector<glm::dvec3> areas;
  for (const auto& [a, b, c] : surface.triangles)
    areas.push_back(
        glm::cross(surface.positions[b] - surface.positions[a], surface.positions[c] - surface.positions[a]));
  const Grouped at = group_by_key(areas.size(), surface.positions.size(), [&](std::size_t t, const auto& emit) {
    for (const std::uint32_t v : surface.triangles[t]) emit(v, std::uint32_t(t));
  });
  Corners all;
  for (std::size_t t = 0; t < areas.size(); ++t)
    for (const std::uint32_t v : surface.triangles[t]) {
      glm::dvec3 normal(0);
      for (std::uint32_t i = at.first[v]; i < at.first[v + 1]; ++i) {
        const glm::dvec3& other = areas[at.values[i]];
        if (glm::dot(other, areas[t]) >= 0.766 * glm::length(other) * glm::length(areas[t])) normal += other;
      }
      all.push_back({glm::vec3(surface.positions[v]), glm::vec3(normal / std::max(glm::length(normal), 1e-300))});
    }
  return all;
}

Corners height_triangles(const Obstacle& o) { return o.field ? smoothed(height_block(o)) : Corners{}; }
Corners mesh_triangles(const Obstacle& o) { return o.surface ? smoothed(*o.surface) : Corners{}; }

Corners tessellate(const Obstacle& o) {
  if (o.kind->picture) return o.kind->picture(o);
  return o.kind->half ? contour(o) : Corners{};
}

}  // namespace tetpbd
