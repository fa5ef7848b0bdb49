// Patches: neighbouring constraints of all kinds, on few vertices, for one work-group each.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/model/constraints.h"

namespace tetpbd {

/// A patch has one chunk, or more where it has too many vertices for one.
struct Patches {
  static constexpr std::size_t most_vertices = 256;  ///< of a chunk: a byte holds their number
  std::size_t count = 0;                             ///< of patches
  /// Words of a chunk: how many vertices, how many of these are owned (they come first), the first of them,
  /// the next chunk of the patch (0: none); then for each kind present its first pair and how many records.
  /// The patches' first chunks come first.
  std::vector<std::uint32_t> chunks;
  std::size_t chunk_words = 0;
  /// `largest` per chunk: the vertex, and the number of constraints on it as float bits.
  std::vector<std::array<std::uint32_t, 2>> vertices;
  /// Constraints, as many pairs of words each as record_pairs() says: its vertices in the chunk, a byte each;
  /// rest values, a material's compliances, and where bodies differ k and damping, as float bits.
  std::vector<std::array<std::uint32_t, 2>> records;
  std::size_t largest = 0, most_owned = 0;  ///< vertices, owned ones, of any chunk
  bool chunked = false;                     ///< any patch has several chunks
};

/// Pairs of words of a record of the list.
inline std::size_t record_pairs(const ConstraintList& list) {
  const std::size_t values = list.rest.size() + list.compliance.size() + list.stiffness.size() + list.damping.size();
  return (1 + values / std::max<std::size_t>(list.count(), 1) + 1) / 2;
}

/// Each constraint in one patch of at most `most`; all its vertices are owned.
Patches constraint_patches(const ConstraintSystem& system, std::size_t most);

/// Patches of at most `own` consecutive vertices, which are owned, and of all constraints on these: a
/// constraint is in each patch that has a vertex of it. `own` is at most most_vertices - 4.
Patches vertex_patches(const ConstraintSystem& system, std::size_t own);

}  // namespace tetpbd
