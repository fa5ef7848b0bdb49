// Colours: constraints of one kind cut into sets that share no vertex, so that a set can be solved in any
// order, or at once.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/model/constraints.h"

namespace tetpbd {

struct Coloured {
  ConstraintList list;             ///< colour after colour, inside one by the smallest vertex number
  std::vector<std::size_t> first;  ///< of each colour, and the end
};
/// Each constraint, by its smallest vertex number, has the first colour that none of its vertices has yet.
/// Deterministic.
Coloured coloured(const ConstraintList& list, std::size_t vertices);

}  // namespace tetpbd
