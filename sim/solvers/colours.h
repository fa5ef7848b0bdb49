// Colours: constraints of one kind cut into sets that share no vertex, or vertices into sets that share no constraint,
// so that a set can be solved in any order, or all at once.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/model/constraints.h"

namespace tetpbd {

struct Coloured {
  ConstraintList list;             ///< colour after colour, in a colour by smallest vertex numbers
  std::vector<std::size_t> first;  ///< of each colour, and the end
};
/// Goes through the constraints by their smallest vertex numbers, and gives each the first colour that none of its
/// vertices has yet.
Coloured coloured(const ConstraintList& list, std::size_t vertices);

struct VertexColours {
  std::vector<std::uint32_t> vertices;  ///< colour after colour, in a colour by number
  std::vector<std::size_t> first;       ///< of each colour, and the end
};
/// Goes through the vertices by number, and gives each the first colour that no vertex it shares a constraint with has.
VertexColours colour_vertices(const ConstraintSystem& system, std::size_t vertices);

}  // namespace tetpbd
