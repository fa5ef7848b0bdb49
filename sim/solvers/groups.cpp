#include "sim/solvers/groups.h"

#include <algorithm>

namespace tetpbd {

std::vector<std::vector<std::uint8_t>> balanced_groups(const ConstraintSystem& system, int groups) {
  const std::size_t count = std::size_t(groups);
  std::vector<std::uint16_t> used(system.at_vertex.size() * count);  // by vertex and group
  std::vector<std::size_t> members(count);
  std::vector<std::vector<std::uint8_t>> result;
  for (const ConstraintList& list : system.lists) {
    auto& chosen = result.emplace_back(list.count());
    const std::size_t arity = std::size_t(list.arity);
    for (std::size_t c = 0; c < list.count(); ++c) {
      const std::uint32_t* vertices = list.vertices.data() + c * arity;
      std::size_t best = 0;
      std::array<std::size_t, 3> least{};
      for (std::size_t g = 0; g < count; ++g) {
        // The most crowded of its vertices counts, then all of them, then the size of the group.
        std::array<std::size_t, 3> crowd{0, 0, members[g]};
        for (std::size_t j = 0; j < arity; ++j) {
          const std::size_t at = used[vertices[j] * count + g];
          crowd[0] = std::max(crowd[0], at), crowd[1] += at;
        }
        if (g == 0 || crowd < least) best = g, least = crowd;
      }
      chosen[c] = std::uint8_t(best);
      ++members[best];
      for (std::size_t j = 0; j < arity; ++j) ++used[vertices[j] * count + best];
    }
  }
  return result;
}

}  // namespace tetpbd
