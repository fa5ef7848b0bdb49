// Which vertices an element list needs: merging those in the same place, dropping those without an element.
#pragma once

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Drops positions that no element names; the others stay in their order. Indices must be in range.
template <std::size_t N>
void drop_unused_vertices(std::vector<glm::dvec3>& positions,
                          std::vector<std::array<std::uint32_t, N>>& elements) {
  std::vector<std::uint32_t> number(positions.size(), 0);
  for (const auto& element : elements)
    for (const std::uint32_t v : element) number[v] = 1;
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (number[v] == 1) {
      number[v] = count;
      positions[count++] = positions[v];
    }
  positions.resize(count);
  for (auto& element : elements)
    for (std::uint32_t& v : element) v = number[v];
}

/// Merges vertices at the same position or nearer than `tolerance` (metres) to one kept before them, drops
/// triangles that collapse by it, then vertices without a triangle. Kept vertices stay in their order.
/// Vertices that are not finite are never merged, so that check_surface() still finds them. Indices must be
/// in range.
void weld(SurfaceMesh& surface, double tolerance);

}  // namespace tetpbd
