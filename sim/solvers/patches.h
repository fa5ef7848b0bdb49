// Patches: neighbouring constraints of all kinds, on few vertices, for one work-group each.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/constraints.h"
#include "sim/model.h"

namespace tetpbd {

struct Patches {
  static constexpr std::size_t most_vertices = 256;  ///< of a part: a byte holds their number
  std::size_t count = 0;  ///< of patches; for several groups of constraints, of each
  /// A patch has more than one part where it has too many vertices for one. Words of a part: how many
  /// vertices, how many of these are summed (they come first), the first summed one (vertex_patches), the
  /// next part of the patch (0: none); then for each kind present its first record and how many. The patches'
  /// first parts come first, group after group.
  std::vector<std::uint32_t> parts;
  std::size_t part_words = 0;
  std::vector<std::array<std::uint32_t, 2>>
      vertices;  ///< `largest` a part; vertex, constraints on it (of the group) as float bits
  std::vector<std::array<std::uint32_t, 2>>
      records;                               ///< the part's vertices, a byte each; rest as float bits
  std::size_t largest = 0, most_summed = 0;  ///< vertices, summed ones, of any part
  bool parted = false;                       ///< any patch has several parts
};

/// Each constraint in one patch of at most `most`; all its vertices are summed.
Patches constraint_patches(const Model& model, const ConstraintSystem& system, std::size_t most);

/// Patches of at most `own` consecutive vertices, which are summed, and of all constraints on these: a
/// constraint is in each patch that has a vertex of it. `members`, if not empty: by kind, which of `groups`
/// each constraint is in; all groups have the same patches of vertices. `own` is at most most_vertices - 4.
Patches vertex_patches(const ConstraintSystem& system, std::size_t own, int groups = 1,
                       const std::vector<std::vector<std::uint8_t>>& members = {});

}  // namespace tetpbd
