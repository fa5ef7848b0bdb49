// One group of constraints by itself, as the tests of mode groups look at it.
#pragma once

#include "sim/solvers/groups.h"

/// The constraints of group `group` alone, in their order; at_vertex counts those.
inline tetpbd::ConstraintSystem group_of(const tetpbd::ConstraintSystem& system,
                                         const std::vector<std::vector<std::uint8_t>>& groups, int group) {
  tetpbd::ConstraintSystem part;
  part.at_vertex.assign(system.at_vertex.size(), 0);
  for (std::size_t k = 0; k < system.lists.size(); ++k) {
    const tetpbd::ConstraintList& list = system.lists[k];
    const std::size_t arity = std::size_t(list.arity);
    tetpbd::ConstraintList& members = part.lists.emplace_back();
    members.arity = list.arity;
    for (std::size_t c = 0; c < list.count(); ++c)
      if (groups[k][c] == group) members.add({list.vertices.data() + c * arity, arity}, list.rest[c]);
    for (std::uint32_t v : members.vertices) ++part.at_vertex[v];
    part.present.push_back(system.present[k]);
  }
  return part;
}
