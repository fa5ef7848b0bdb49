// Measures how deep bodies are in each other, in double on the CPU, by their tets and independently of contact.
#pragma once

#include "sim/measure/crossings.h"

namespace tetpbd {

struct Overlap {
  std::size_t inside = 0;  ///< vertices of surfaces that are in a tet of another body
  Crossings crossings;
  double largest = 0;   ///< largest depth of such a vertex under that body's surface, over the size of its own
  double deepest = 0;   ///< largest depth, m
  double part_999 = 0;  ///< depth below which 99.9 % of all vertices of surfaces stay, over the size
};
/// With `self` a body also overlaps itself, but not with tets near a vertex at rest or triangles with a common vertex.
Overlap measure_overlap(const Model& model, const std::vector<glm::dvec3>& positions, bool self);
/// The larger of each member.
Overlap largest(const Overlap& a, const Overlap& b);

}  // namespace tetpbd
