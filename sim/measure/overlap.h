// How deep bodies are in each other: measured in double on the CPU, by the tets, not by what contact found.
#pragma once

#include "sim/model/model.h"

namespace tetpbd {

struct Overlap {
  std::size_t inside = 0;     ///< vertices of surfaces that are in a tet of another body
  std::size_t triangles = 0;  ///< pairs of triangles of surfaces that go through each other
  double largest = 0;         ///< from such a vertex to the surface of that body, over its own body's size at rest
  double deepest = 0;         ///< m, the same of any
  double part_999 = 0;        ///< which 99.9 % of all vertices of surfaces keep below
};
/// `self`: and of its own body, but tets near it at rest and triangles with a vertex in common.
Overlap measure_overlap(const Model& model, const std::vector<glm::dvec3>& positions, bool self);
/// The larger of each.
Overlap largest(const Overlap& a, const Overlap& b);

}  // namespace tetpbd
