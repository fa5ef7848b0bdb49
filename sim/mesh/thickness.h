// How thin a body is, by rays inward from points of its surface.
#pragma once

#include <cmath>
#include <vector>

#include "sim/mesh/solid.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// How well a body's tets can stand for its surface; NaN: not known.
struct Fit {
  double thinnest = NAN;        ///< m, its thinnest part, but for a fiftieth of its surface
  glm::dvec3 thinnest_at{NAN};  ///< m, a point there
  double gap = NAN;             ///< m, of what is drawn from what collides, at most
  double edge = NAN;            ///< m, the mean edge of its tets
};

struct Depth {
  double depth;   ///< m, to where the ray leaves the body; infinite where it never does
  glm::dvec3 at;  ///< where it begins
};
/// Of rays from about 2000 points, spread evenly over the surface; the shortest first. `solid` is of that surface.
std::vector<Depth> measure_depths(const SurfaceMesh& surface, const Solid& solid);
/// The one of them that is the thinnest part; none of those: NaN.
Depth thinnest(const std::vector<Depth>& depths);
/// Of a closed surface that looks outward; of more than 300 000 triangles, which would take seconds: NaN.
Depth thinnest_part(const SurfaceMesh& surface);
double area_of(const SurfaceMesh& surface);  ///< m^2

}  // namespace tetpbd
