// The reference motion of k = 1: rigid bodies on obstacles, with Coulomb friction and restitution, in double. In
// Moreau's time stepping (Moreau 1988; Jean 1999) all contacts of a step are solved together, by nonsmooth Gauss-Seidel
// to convergence. Bodies do not touch each other.
#pragma once

#include <vector>

#include "sim/model/model.h"
#include "sim/model/settings.h"

namespace tetpbd {

/// A body's placement and momentum. Its inertia is that of its vertices' masses, as in the solvers.
struct RigidBody {
  std::size_t first = 0;         ///< its first vertex in the model
  std::vector<glm::dvec3> rest;  ///< m, its vertices from the centre of mass, at rest
  double mass = 0;               ///< kg
  glm::dmat3 inertia{0};         ///< kg m^2, in the rest shape's axes
  glm::dvec3 centre{0};          ///< m
  glm::dmat3 rotation{1};
  glm::dvec3 velocity{0};  ///< m/s
  glm::dvec3 angular{0};   ///< kg m^2/s, about the centre
  std::size_t number = 0;  ///< of the body in the model
  double radius = 0;       ///< m, of the vertices about the centre
  bool held = false;       ///< by fixed vertices: it stays in place
  /// The vertices that were within `reach` (m) of an obstacle when they were found, and how far any has moved since.
  std::vector<std::uint32_t> near{};
  double reach = 0, moved = 1;
  double time = 0;                                             ///< s
  std::vector<std::pair<std::size_t, glm::dvec3>> impulses{};  ///< N s, of the last step's contacts, by their number
};

/// The model's bodies at their start. Throws Error where a body can turn about its fixed vertices, which are all on a
/// line, and where it does not start as its rest shape in rigid motion.
std::vector<RigidBody> rigid_bodies(const Model& model);
/// Advances a body by `h` seconds under the settings' gravity, ground, friction and restitution (Newton's, the normal
/// velocity after an impact over that before) and the model's obstacles. Of second order in flight, first in contact.
void advance(RigidBody& body, const Model& model, const Settings& settings, double h);
/// The model's vertices, moved with the bodies.
State make_state(const Model& model, const std::vector<RigidBody>& bodies);

}  // namespace tetpbd
