#include <fmt/format.h>

#include <cmath>

#include "sim/error.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

// Kuhn's subdivision: a tet for each order of walking from the cell's low corner to its high one along the
// three axes. All cells share the diagonal's direction, so the faces of neighbours match.
TetMesh make_block(const glm::dvec3& size, const glm::ivec3& cells) {
  const std::string source = fmt::format("block of {} x {} x {} cells, {:g} x {:g} x {:g} m", cells.x,
                                         cells.y, cells.z, size.x, size.y, size.z);
  if (!(size.x > 0 && size.y > 0 && size.z > 0) || !std::isfinite(size.x + size.y + size.z))
    throw Error("size must be above 0", source, "give three lengths in metres");
  if (cells.x < 1 || cells.y < 1 || cells.z < 1)
    throw Error("cells must be 1 or more", source, "give three counts");
  const double count = 6.0 * cells.x * cells.y * cells.z;
  if (count > 1e8)
    throw Error(fmt::format("{:.0f} tets are too many", count), source, "give at most 1e8 / 6 cells");

  TetMesh mesh;
  const glm::ivec3 nodes = cells + 1;
  for (int z = 0; z < nodes.z; ++z)
    for (int y = 0; y < nodes.y; ++y)
      for (int x = 0; x < nodes.x; ++x)
        mesh.positions.push_back(size * (glm::dvec3(x, y, z) / glm::dvec3(cells) - 0.5));
  const std::array<std::uint32_t, 3> step{1, std::uint32_t(nodes.x),
                                          std::uint32_t(nodes.x) * std::uint32_t(nodes.y)};
  constexpr std::array<std::array<std::uint8_t, 3>, 6> orders{
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  mesh.tets.reserve(std::size_t(count));
  for (int z = 0; z < cells.z; ++z)
    for (int y = 0; y < cells.y; ++y)
      for (int x = 0; x < cells.x; ++x) {
        const std::uint32_t corner =
            std::uint32_t(x) + std::uint32_t(y) * step[1] + std::uint32_t(z) * step[2];
        for (const auto& order : orders) {
          const std::uint32_t first = corner + step[order[0]], second = first + step[order[1]];
          mesh.tets.push_back({corner, first, second, second + step[order[2]]});
        }
      }
  finish_tets(mesh, source);
  return mesh;
}

}  // namespace tetpbd
