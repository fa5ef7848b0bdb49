// Constraints cut into patches: neighbouring ones of all kinds, on few vertices, for one work-group each.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/constraints.h"
#include "sim/model.h"

namespace tetpbd {

struct Patches {
  static constexpr std::size_t most_vertices = 256;  ///< of a patch: a byte holds their number
  std::size_t count = 0;
  std::vector<std::uint32_t>
      rows;  ///< per patch: first vertex, first record of each kind present, end; then end of vertices
  std::vector<std::array<std::uint32_t, 2>> vertices;  ///< vertex, n_i as float bits
  std::vector<std::array<std::uint32_t, 2>> records;   ///< patch's vertices, a byte each; rest as float bits
};

/// Patches of at most `most` constraints. A patch's records lie together, kind after kind.
Patches make_patches(const Model& model, const ConstraintSystem& system, std::size_t most);

}  // namespace tetpbd
