// The judge of contact: triangles of surfaces that cut each other, found exactly and independently of contact.
#pragma once

#include <array>

#include "sim/model/model.h"

namespace tetpbd {

struct Crossings {
  std::size_t pairs = 0;
  std::array<std::uint32_t, 2> first{};  ///< of these pairs, triangles of Model::rest.surface
  /// Of all edges that pass through a triangle, how far the nearer end is beyond it, over the lengths of the pair's
  /// edges, at most.
  double depth = 0;
};

/// The positions (m) are taken as they are: no rounding decides. Triangles that share a vertex, or of which no vertex
/// can move, are left out, and so are those of one body without `self`. Bodies that touch without cutting do not count.
Crossings find_crossings(const Model& model, const std::vector<glm::dvec3>& positions, bool self);

/// The more pairs of the two, and the larger depth.
Crossings largest(const Crossings& a, const Crossings& b);

/// The sign of six times the volume of the tet a, b, c, d, exactly; 0 where they are in one plane.
int orientation(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d);

}  // namespace tetpbd
