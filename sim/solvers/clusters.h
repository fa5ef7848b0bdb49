// Clusters: few neighbouring constraints of all kinds, which one invocation solves one after the other, cut into
// colours that share no vertex (Ton-That, Kry and Andrews 2022).
#pragma once

#include <cstddef>
#include <vector>

#include "sim/solvers/patches.h"

namespace tetpbd {

struct Clusters {
  /// Constraints of a cluster, unless Tuning says otherwise. Larger ones need fewer colours (24 for 51 on soft-beam
  /// with 8), but on an NVIDIA H200 what they solve one after the other takes longer than the dispatches that they
  /// save: 8.25 ms for 20 iterations with 1, 9.04 with 4, 10.95 with 8, 15.0 with 16; bunny-drop takes 15 to 16 ms with
  /// each.
  static constexpr std::size_t usual = 1;
  std::vector<std::vector<ConstraintRef>> members;  ///< colour after colour; of each, kind by kind
  std::vector<std::size_t> first;                   ///< cluster of each colour, and the end
};

/// Cuts all constraints into clusters of at most `most`, and these into colours. The system alone decides how.
Clusters cluster_constraints(const ConstraintSystem& system, std::size_t most);

}  // namespace tetpbd
