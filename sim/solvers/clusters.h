// Clusters: few neighbouring constraints of all kinds, which one invocation solves one after the other, cut into
// colours that share no vertex (Ton-That, Kry and Andrews 2022).
#pragma once

#include <cstddef>
#include <vector>

#include "sim/solvers/patches.h"

namespace tetpbd {

struct Clusters {
  /// Constraints of a cluster, unless Tuning says otherwise. Without clusters, soft-beam and bunny-drop need 51 and 113
  /// colours, with clusters of 8 only 24 and 43; 16 take away few more (20 and 28), and the constraints that are solved
  /// one after the other in an iteration become 1.6 and 1.3 times as many.
  static constexpr std::size_t usual = 8;
  std::vector<std::vector<ConstraintRef>> members;  ///< colour after colour; of each, kind by kind
  std::vector<std::size_t> first;                   ///< cluster of each colour, and the end
};

/// Cuts all constraints into clusters of at most `most`, and these into colours. The system alone decides how.
Clusters cluster_constraints(const ConstraintSystem& system, std::size_t most);

}  // namespace tetpbd
