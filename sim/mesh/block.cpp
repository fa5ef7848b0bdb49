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
  const glm::uvec3 nodes(cells + 1);
  const auto each_of = [](const glm::uvec3& counts, const auto& visit) {
    for (std::uint32_t z = 0; z < counts.z; ++z)
      for (std::uint32_t y = 0; y < counts.y; ++y)
        for (std::uint32_t x = 0; x < counts.x; ++x) visit(glm::uvec3(x, y, z));
  };
  each_of(nodes, [&](const glm::uvec3& at) {
    mesh.positions.push_back(size * (glm::dvec3(at) / glm::dvec3(cells) - 0.5));
  });
  const glm::uvec3 step(1, nodes.x, nodes.x * nodes.y);
  constexpr std::array<std::array<int, 3>, 6> orders{
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  each_of(glm::uvec3(cells), [&](const glm::uvec3& at) {
    const std::uint32_t corner = at.x + at.y * step.y + at.z * step.z;
    for (const auto& [i, j, k] : orders)
      mesh.tets.push_back(
          {corner, corner + step[i], corner + step[i] + step[j], corner + step[0] + step[1] + step[2]});
  });
  finish_tets(mesh, source);
  return mesh;
}

}  // namespace tetpbd
