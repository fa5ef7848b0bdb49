// Rigid handles: a coarse level for bodies whose constraints are hard. Overlapping soft-edged parts of a
// body, each of which pulls its vertices towards its best-fitting rigid pose (shape matching, Mueller et al.
// 2005), in one dispatch with the constraints.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "sim/layout.h"
#include "sim/model.h"
#include "sim/settings.h"

namespace tetpbd {

namespace glsl {
using namespace glm;
struct Rigid {
#define precise
#include "shaders/rigid.glsl"
#undef precise
};
}  // namespace glsl

struct Handles {
  std::vector<layout::Handle> handles;
  std::vector<glm::vec4>
      rest;  ///< by vertex: where in its body's lattice, in cells; mass, in units of a weight
};
/// A lattice over each body's box, about 0.6 of its diagonal a cell; a handle at each node that has vertices.
/// Lattices do not touch.
Handles build_handles(const Model& model);

/// Whether settings ask for handles where they are: in mode node, without compliance.
bool wants_handles(const Settings& settings);

/// The rotation nearest to A = sum w x X^T, in trace(R^T A); a rotation whatever A is.
glm::dmat3 rotation_of(const glm::dmat3& A);

struct HandlePose {
  glm::dmat3 R{1};
  glm::dvec3 place{0};  ///< m, of the handle's centre
};
/// The rigid poses nearest to the vertices (method.md eqs. 28-29).
std::vector<HandlePose> handle_poses(const Handles& handles, const std::vector<glm::dvec3>& positions);
/// What handles pull each vertex by at full strength, m (method.md eq. 30).
std::vector<glm::dvec3> handle_pulls(const Handles& handles, const std::vector<glm::dvec3>& positions);
/// The over-relaxation that goes with handles of this strength: both together must not go beyond the answer
/// by a third (method.md eq. 31).
double relaxation(double omega, double handles);

}  // namespace tetpbd
