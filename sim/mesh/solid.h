// The inside of a surface that need not be closed, clean or in one piece: generalized winding numbers (Jacobson, Kavan
// and Sorkine-Hornung 2013; by dipoles: Barill et al. 2018), nearest points and crossings by a tree of boxes.
#pragma once

#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Keeps a reference to the surface, whose triangles look outward from what is solid (turn_outward()).
class Solid {
 public:
  explicit Solid(const SurfaceMesh& surface);
  /// 1 inside a closed surface, 0 outside, in between near the holes of an open one; 2 where two solids overlap.
  double winding(const glm::dvec3& p) const;
  struct Nearest {
    double distance;  ///< m; `limit` where nothing is nearer
    glm::dvec3 point;
    std::uint32_t triangle;
  };
  Nearest nearest(const glm::dvec3& p, double limit = INFINITY) const;
  struct Crossing {
    double at;    ///< from 0 at a to 1 at b
    double jump;  ///< by which the winding number grows there
  };
  /// Where the segment from a to b crosses triangles, in order; replaces what was in `found`.
  void find_crossings(const glm::dvec3& a, const glm::dvec3& b, std::vector<Crossing>& found) const;
  /// The winding number at b, where it is `at_a` at a; found without a sum over all triangles.
  double winding_at(const glm::dvec3& b, const glm::dvec3& a, double at_a) const;
  /// Whether the segment from a, where the winding number is `at_a`, stays inside.
  bool sees(const glm::dvec3& a, double at_a, const glm::dvec3& b) const;

 private:
  struct Node {
    glm::dvec3 low, high, centre, normal;  ///< centre of area; sum of area vectors, m^2
    double radius;                         ///< about `centre`
    std::uint32_t first, count, right;     ///< triangles of `order`; right 0: a leaf, whose left is the next node
  };
  void build(std::uint32_t first, std::uint32_t count, const std::vector<glm::dvec3>& middles);
  template <class Enter, class Visit>
  void walk(Enter&& enter, Visit&& visit) const;
  const SurfaceMesh& surface;
  std::vector<Node> nodes;
  std::vector<std::uint32_t> order;
};

constexpr double inside_winding = 0.5;  ///< above it a point is inside

}  // namespace tetpbd
