// Two tets or triangles: how deep they are in each other, by the separating axis theorem (Gottschalk, Lin, Manocha
// 1996). All in double.
#pragma once

#include <array>
#include <glm/glm.hpp>

namespace tetpbd {

/// The convex hull of three or four points.
struct ConvexCell {
  std::array<glm::dvec3, 4> corners{};  ///< m; of a triangle the last repeats the first
  int count = 0;                        ///< 3 or 4
};

/// m, the shortest way to move one that leaves `gap` between them, or a little more; 0 where there is as much. A
/// triangle has no inside: its depth is measured through its plane and along its edges.
double overlap_depth(const ConvexCell& a, const ConvexCell& b, double gap = 0);

/// m, how far `a` has to go along `direction` (of unit length) until that is so; infinite where it never is. Where it
/// is no more than `enough`, it may be found too large.
double exit_distance(const ConvexCell& a, const ConvexCell& b, const glm::dvec3& direction, double enough = 0,
                     double gap = 0);

}  // namespace tetpbd
