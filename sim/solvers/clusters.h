// Shape-matching clusters: a coarse level for bodies whose constraints are hard. Overlapping soft-edged parts
// of a body, each of which pulls its vertices towards its best-fitting rigid pose (Mueller et al. 2005), in
// one dispatch with the constraints. They pull to the rest shape: right only where the answer is rigid.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "sim/layout.h"
#include "sim/model.h"

namespace tetpbd {

namespace glsl {
using namespace glm;
struct ShapeMatching {
#define precise
#include "shaders/shape_matching.glsl"
#undef precise
};
}  // namespace glsl

struct Clusters {
  std::vector<layout::Cluster> clusters;
  /// By vertex: where in its body's lattice, in cells; mass, in units of a weight.
  std::vector<glm::vec4> rest;
};
/// A lattice over each body's box, about 0.6 of its diagonal a cell; a cluster at each node that has
/// vertices. Lattices do not touch.
Clusters build_clusters(const Model& model);

struct ClusterPose {
  glm::dmat3 R{1};
  glm::dvec3 place{0};  ///< m, of the cluster's centre
};
/// The rigid poses nearest to the vertices (method.md eqs. 28-29).
std::vector<ClusterPose> cluster_poses(const Clusters& clusters, const std::vector<glm::dvec3>& positions);
/// What clusters pull each vertex by at full strength, m (method.md eq. 30).
std::vector<glm::dvec3> cluster_pulls(const Clusters& clusters, const std::vector<glm::dvec3>& positions);
/// The over-relaxation that goes with clusters of this strength: both together must not go beyond the answer
/// by a third (method.md eq. 31).
double relaxation(double omega, double clusters);

}  // namespace tetpbd
