#include "render/shapes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "render/layout.h"
#include "render/renderer.h"
#include "sim/layout.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

using Corner = ShapeSurfaces::Corner;

void add_triangle(std::vector<Corner>& all, Corner a, Corner b, const Corner& c) {
  const glm::vec3 area = glm::cross(b.position - a.position, c.position - a.position);
  if (glm::length(area) == 0) return;
  if (glm::dot(area, a.normal + b.normal + c.normal) < 0) std::swap(a, b);
  all.insert(all.end(), {a, b, c});
}

// A ball of radius `round` drawn out: by `half` along the axes and by `disk` about the y axis. Edges of boxes
// and cylinders are a little round, which is what catches the light.
std::vector<Corner> rounded(const glm::vec3& half, float disk, float round) {
  const int around = disk > 0 || half.x == 0 ? 16 : 3, up = half.x > 0 || disk > 0 ? 3 : 16;  // a quarter
  std::vector<std::vector<Corner>> rows;
  for (int side = -1; side <= 1; side += 2)
    for (int i = 0; i <= up; ++i) {
      const float rise = float(side < 0 ? i - up : i) / float(up) * 0.5f * std::numbers::pi_v<float>;
      std::vector<Corner>& row = rows.emplace_back();
      for (int quarter = 0; quarter < 4; ++quarter)
        for (int k = 0; k <= around; ++k) {
          const float turn = (float(quarter) + float(k) / float(around)) * 0.5f * std::numbers::pi_v<float>;
          const glm::vec3 away(std::cos(turn), 0, std::sin(turn)),
              normal = std::cos(rise) * away + glm::vec3(0, std::sin(rise), 0);
          const glm::vec3 corner(quarter == 0 || quarter == 3 ? 1 : -1, side, quarter < 2 ? 1 : -1);
          row.push_back({half * corner + disk * away + round * normal, normal});
        }
    }
  std::vector<Corner> all;
  const std::size_t count = rows[0].size();
  for (std::size_t j = 0; j < count; ++j) {
    const std::size_t next = (j + 1) % count;
    for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
      add_triangle(all, rows[i][j], rows[i][next], rows[i + 1][j]);
      add_triangle(all, rows[i][next], rows[i + 1][next], rows[i + 1][j]);
    }
    for (const auto* end : {&rows.front(), &rows.back()}) {
      const glm::vec3 axis(0, (*end)[0].normal.y < 0 ? -1 : 1, 0);
      add_triangle(all, {axis * (half.y + round), axis}, {(*end)[j].position, axis},
                   {(*end)[next].position, axis});
    }
  }
  return all;
}

// Round where triangles meet at less than 40 degrees.
std::vector<Corner> smoothed(const SurfaceMesh& surface) {
  std::vector<glm::dvec3> areas;
  for (const auto& [a, b, c] : surface.triangles)
    areas.push_back(
        glm::cross(surface.positions[b] - surface.positions[a], surface.positions[c] - surface.positions[a]));
  const Grouped at =
      group_by_key(areas.size(), surface.positions.size(), [&](std::size_t t, const auto& emit) {
        for (const std::uint32_t v : surface.triangles[t]) emit(v, std::uint32_t(t));
      });
  std::vector<Corner> all;
  for (std::size_t t = 0; t < areas.size(); ++t)
    for (const std::uint32_t v : surface.triangles[t]) {
      glm::dvec3 normal(0);
      for (std::uint32_t i = at.first[v]; i < at.first[v + 1]; ++i) {
        const glm::dvec3& other = areas[at.values[i]];
        if (glm::dot(other, areas[t]) >= 0.766 * glm::length(other) * glm::length(areas[t])) normal += other;
      }
      all.push_back(
          {glm::vec3(surface.positions[v]), glm::vec3(normal / std::max(glm::length(normal), 1e-300))});
    }
  return all;
}

// The heights with walls around them.
SurfaceMesh block_of(const Obstacle& o) {
  const glm::ivec3 size = o.field->size;
  SurfaceMesh block;
  const auto at = [&](int i, int k, bool top) {
    const double y = top ? double(o.field->values[std::size_t(i + size.x * k)]) : -o.half.y;
    block.positions.emplace_back(o.half.x * (2.0 * i / (size.x - 1) - 1), y,
                                 o.half.z * (2.0 * k / (size.z - 1) - 1));
  };
  for (int k = 0; k < size.z; ++k)
    for (int i = 0; i < size.x; ++i) at(i, k, true);
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
  for (const glm::ivec2& p : rim) at(p.x, p.y, false);
  for (int r = 0; r < count; ++r) {
    const int next = (r + 1) % count;
    const auto top = [&](int place) {
      return rim[std::size_t(place)].x + size.x * rim[std::size_t(place)].y;
    };
    quad(top(r), below + r, below + next, top(next));
  }
  return block;
}

// Half the extent along its own axes.
glm::dvec3 own_half(const Obstacle& o) {
  if (o.shape == SHAPE_BOX || o.shape == SHAPE_HEIGHTS) return o.half;
  if (o.shape == SHAPE_CYLINDER) return {o.radius, o.half_length, o.radius};
  if (o.shape == SHAPE_CAPSULE) return {o.radius, o.half_length + o.radius, o.radius};
  if (o.shape == SHAPE_GRID && o.surface)
    return 0.5 * (bounds(o.surface->positions).high - bounds(o.surface->positions).low);
  return glm::dvec3(o.radius);
}

// Made where shapes are others than before: the window changes them.
void make_surfaces(ShapeSurfaces& surfaces, const Model& model) {
  std::vector<double> made_of;
  for (const Obstacle& o : model.shapes) {
    for (const double x : {double(o.shape), o.radius, o.half_length, o.half.x, o.half.y, o.half.z})
      made_of.push_back(x);
    made_of.push_back(double(std::uintptr_t(o.surface ? (const void*)o.surface.get() : o.field.get())));
  }
  if (made_of == surfaces.made_of) return;
  std::vector<Corner> corners;
  surfaces.first = {0};
  for (const Obstacle& o : model.shapes) {
    const std::vector<Corner> own = tessellated(o);
    corners.insert(corners.end(), own.begin(), own.end());
    surfaces.first.push_back(int(corners.size()));
  }
  surfaces.corners = Buffer("surfaces of shapes", corners);
  surfaces.array = VertexArray("shapes");
  attribute(ATTRIBUTE_HIGH, surfaces.corners.id(), 3, sizeof(Corner), offsetof(Corner, position));
  attribute(ATTRIBUTE_NORMAL, surfaces.corners.id(), 3, sizeof(Corner), offsetof(Corner, normal));
  surfaces.made_of = std::move(made_of);
}

}  // namespace

std::vector<Corner> tessellated(const Obstacle& o) {
  const float r = float(o.radius),
              edge = 0.04f * float(std::min({own_half(o).x, own_half(o).y, own_half(o).z}));
  if (o.shape == SHAPE_SPHERE) return rounded(glm::vec3(0), 0, r);
  if (o.shape == SHAPE_CAPSULE) return rounded({0, o.half_length, 0}, 0, r);
  if (o.shape == SHAPE_BOX) return rounded(glm::vec3(o.half) - edge, 0, edge);
  if (o.shape == SHAPE_CYLINDER) return rounded({0, float(o.half_length) - edge, 0}, r - edge, edge);
  if (o.shape == SHAPE_HEIGHTS && o.field) return smoothed(block_of(o));
  if (o.shape == SHAPE_GRID && o.surface) return smoothed(*o.surface);
  return {};
}

Bounds with_shapes(const Bounds& box, const Model& model, double time, double reach) {
  Bounds all = box;
  for (const Obstacle& o : model.shapes) {
    if (o.shape == SHAPE_PLANE) continue;
    const Pose pose = pose_at(o, time);
    const glm::dmat3 sizes{glm::abs(pose.axes[0]), glm::abs(pose.axes[1]), glm::abs(pose.axes[2])};
    const glm::dvec3 half = sizes * own_half(o), low = box.low - reach, high = box.high + reach;
    all.low = glm::min(all.low, glm::clamp(pose.centre - half, low, high));
    all.high = glm::max(all.high, glm::clamp(pose.centre + half, low, high));
  }
  return all;
}

void draw_shapes(Renderer& renderer, const Frame& frame, bool shadow) {
  if (!frame.model || frame.model->shapes.empty()) return;
  ShapeSurfaces& surfaces = renderer.shapes;
  make_surfaces(surfaces, *frame.model);
  const Program& program = use(renderer, shadow ? "shapes shadow" : "shapes");
  glBindVertexArray(surfaces.array.id());
  for (std::size_t i = 0; i < frame.model->shapes.size(); ++i) {
    const Pose pose = pose_at(frame.model->shapes[i], frame.time);
    const glm::mat3 axes(pose.axes);
    program.set("right", axes[0]), program.set("up", axes[1]), program.set("front", axes[2]);
    program.set("centre", glm::vec3(pose.centre));
    if (!shadow) program.set("chosen", frame.chosen_shape == int(i) ? 1 : 0);
    glDrawArrays(GL_TRIANGLES, surfaces.first[i], surfaces.first[i + 1] - surfaces.first[i]);
  }
}

}  // namespace tetpbd
