#include "render/carried.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "render/layout.h"
#include "sim/parallel.h"

namespace tetpbd {
namespace {

constexpr double edge_cosine = 0.574;  // 55 degrees, as for the tets' own boundary

// Packs a direction into 12 bits for each coordinate in the square to which an octahedron unfolds.
std::uint32_t pack_normal(glm::dvec3 n) {
  n /= std::max(std::abs(n.x) + std::abs(n.y) + std::abs(n.z), 1e-300);
  glm::dvec2 at(n);
  if (n.z < 0) at = {std::copysign(1 - std::abs(n.y), n.x), std::copysign(1 - std::abs(n.x), n.y)};
  const auto part = [](double x) { return std::uint32_t(std::clamp(std::lround((x + 1) * 2047), 0l, 4095l)); };
  return part(at.x) | part(at.y) << 12;
}

// Packs three weights of 24 bits, each with a third of the normal's 24 bits above it, and the tet.
glm::uvec4 pack(const CarriedVertex& vertex, const glm::dvec3& normal) {
  const std::uint32_t bits = pack_normal(normal);
  const auto word = [&](int k) {
    const double steps = (double(vertex.weights[k]) + 4) * 2097152;
    return std::uint32_t(std::clamp(std::llround(steps), 0ll, 0xffffffll)) | (bits >> (8 * k) & 0xffu) << 24;
  };
  return {word(0), word(1), word(2), vertex.tet};
}

void attach(int unit, Texture& texture, GLenum format, GLuint buffer) {
  glActiveTexture(GL_TEXTURE0 + GLenum(unit));
  if (!texture) texture = Texture("texels of a buffer", GL_TEXTURE_BUFFER);
  glBindTexture(GL_TEXTURE_BUFFER, texture.id());
  glTexBuffer(GL_TEXTURE_BUFFER, format, buffer);
}

}  // namespace

bool shows_carried(const Renderer& renderer, const ViewOptions& options) {
  if (renderer.carried.triangles.empty() || options.look != Look::surface || options.is_cut() ||
      options.colour == Colour::patch)
    return false;
  GLint most = 0;  // texels of a buffer texture, at least 65536
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most);
  return 3 * renderer.mesh.positions.size() <= std::size_t(most) && renderer.mesh.tets.size() <= std::size_t(most);
}

// A vertex on a sharp edge has a normal for each side, and so becomes several.
void make_carried(Renderer& renderer) {
  const CarriedSurface& surface = renderer.carried;
  const auto& triangles = surface.triangles;
  const auto positions = carried_positions(surface, renderer.mesh.tets, renderer.mesh.positions);
  struct Corner {
    glm::dvec3 normal;  // of the triangle
    double angle;
  };
  std::vector<Corner> corners(3 * triangles.size());
  parallel_for(corners.size(), [&](std::size_t c) {
    const auto at = [&](std::size_t k) { return positions[triangles[c / 3][(c + k) % 3]]; };
    const glm::dvec3 a = at(1) - at(0), b = at(2) - at(0), area = glm::cross(a, b);
    const double size = glm::length(area);
    corners[c] = {size > 0 ? area / size : glm::dvec3(0), std::atan2(size, glm::dot(a, b))};
  });
  const Grouped around = group_by_key(corners.size(), positions.size(), [&](std::size_t c, const auto& emit) {
    emit(triangles[c / 3][c % 3], std::uint32_t(c));
  });
  std::vector<glm::uvec4> vertices;
  std::vector<std::uint32_t> indices(corners.size());
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const std::size_t own = vertices.size();
    for (std::uint32_t i = around.first[v]; i < around.first[v + 1]; ++i) {
      const Corner& corner = corners[around.values[i]];
      glm::dvec3 sum(0);
      for (std::uint32_t j = around.first[v]; j < around.first[v + 1]; ++j)
        if (const Corner& other = corners[around.values[j]]; glm::dot(other.normal, corner.normal) >= edge_cosine)
          sum += other.normal * other.angle;
      const glm::uvec4 vertex = pack(surface.vertices[v], sum);
      const auto found = std::find(vertices.begin() + std::ptrdiff_t(own), vertices.end(), vertex);
      indices[around.values[i]] = std::uint32_t(found - vertices.begin());
      if (found == vertices.end()) vertices.push_back(vertex);
    }
  }
  renderer.carried_vertices = Buffer("carried vertices", vertices);
  renderer.carried_triangles = Buffer("carried indices", indices);
  renderer.carried_array = VertexArray("carried");
  glBindBuffer(GL_ARRAY_BUFFER, renderer.carried_vertices.id());
  glEnableVertexAttribArray(ATTRIBUTE_CARRIED);
  glVertexAttribIPointer(ATTRIBUTE_CARRIED, 4, GL_UNSIGNED_INT, sizeof(glm::uvec4), nullptr);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, renderer.carried_triangles.id());
}

void draw_carried(Renderer& renderer, const Frame& frame, const Program& program, GLuint values) {
  program.set("valued", values ? 1 : 0);
  const std::tuple<int, GLenum, GLuint> buffers[] = {
      {UNIT_POSITIONS, GL_RGBA32F, frame.positions},
      {UNIT_TETS, GL_RGBA32UI, shown_tet_buffer(renderer).id()},
      {UNIT_REST, GL_RGBA32F, rest_buffer(renderer).id()},
      {UNIT_COFACTORS, GL_RGBA32F, renderer.cofactors.values.id()},
      {UNIT_VALUES, GL_R32F, values ? values : renderer.cofactors.values.id()}};  // GL wants some buffer there
  for (auto texture = renderer.carried_texels.begin(); const auto& [unit, format, buffer] : buffers)
    attach(unit, *texture++, format, buffer);
  glActiveTexture(GL_TEXTURE0);
  glEnable(GL_CLIP_DISTANCE0);
  glBindVertexArray(renderer.carried_array.id());
  glDrawElements(GL_TRIANGLES, GLsizei(renderer.carried_triangles.bytes() / sizeof(std::uint32_t)), GL_UNSIGNED_INT,
                 nullptr);
  glDisable(GL_CLIP_DISTANCE0);
}

}  // namespace tetpbd
