// Patches of neighbouring constraints of all kinds on few vertices, one for each work-group.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <vector>

#include "sim/model/constraints.h"

namespace tetpbd {

/// A patch has one chunk, or more where it has too many vertices for one.
struct Patches {
  static constexpr std::size_t most_vertices = 256;  ///< in a chunk: a byte holds a vertex's number in it
  std::size_t count = 0;                             ///< number of patches
  /// The header of a chunk: how many vertices it has, how many of these the patch owns (they come first), the first of
  /// them, the patch's next chunk (0: none); then for each kind present its first pair of words and number of records.
  /// The first chunks of all patches come before all others.
  std::vector<std::uint32_t> chunks;
  std::size_t chunk_words = 0;
  /// `largest` for each chunk: a vertex, and the number of constraints on it as float bits.
  std::vector<std::array<std::uint32_t, 2>> vertices;
  /// The records of constraints, record_pairs() pairs of words each: vertices by their numbers in the chunk, a byte
  /// each; then as float bits rest values, a material's compliances, and where bodies differ k and damping.
  std::vector<std::array<std::uint32_t, 2>> records;
  std::vector<std::array<std::uint32_t, 2>>
      tets;  ///< where asked for, of each neo-Hookean record the constraint, and its first pair
  std::size_t largest = 0, most_owned = 0;  ///< most vertices, and most owned ones, of any chunk
  bool chunked = false;                     ///< any patch has several chunks
};

struct ConstraintRef {
  std::uint32_t kind, constraint;
  auto operator<=>(const ConstraintRef&) const = default;
};

/// How many pairs of words a record of the list has.
inline std::size_t record_pairs(const ConstraintList& list) {
  const std::size_t values = list.rest.size() + list.compliance.size() + list.stiffness.size() + list.damping.size();
  return (1 + values / std::max<std::size_t>(list.count(), 1) + 1) / 2;
}

/// Patches of at most `most` constraints, which own all their vertices: each constraint is in one patch.
Patches constraint_patches(const ConstraintSystem& system, std::size_t most, bool with_tets = false);

/// Patches of these constraints, at most 32 of a kind in each, whose records are in this order within a kind.
Patches pack_patches(const ConstraintSystem& system, const std::vector<std::vector<ConstraintRef>>& members,
                     bool with_tets = false);

/// Patches that own at most `own` consecutive vertices, and have all constraints on these: a constraint is in each
/// patch that owns a vertex of it. `own` is at most most_vertices - 4.
Patches vertex_patches(const ConstraintSystem& system, std::size_t own, bool with_tets = false);

}  // namespace tetpbd
