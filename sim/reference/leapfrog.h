// The reference motion of a body with compliance by explicit leapfrog in double, in steps far shorter than its fastest
// vibration allows, without linear systems or tolerances. Contact with obstacles has Coulomb friction and no bounce;
// that of bodies with each other is the CPU modes', whose limit of ever shorter steps counts as exact.
#pragma once

#include <random>
#include <vector>

#include "sim/contact/offset_contact.h"
#include "sim/parallel.h"
#include "sim/reference/objective.h"
#include "sim/reference/reference.h"
#include "sim/reference/ten_node.h"

namespace tetpbd {

/// A run in steps of `h`. It obeys the settings' gravity, ground, friction, damping and constraint_damping.
struct Leapfrog {
  ReferenceInput input;
  Compliances compliances;
  double h = 0;                     ///< s
  Points x;                         ///< m, at the time reached
  Points v;                         ///< m/s, half a step before
  Points parts;                     ///< N, forces by constraint and vertex of it, one kind after the other
  std::vector<TenNodeTet> tets;     ///< of ten nodes, whose parts come last
  Grouped at_vertex;                ///< the parts that act on each vertex
  std::vector<double> time = {0};   ///< s, one number
  std::vector<Average> averages{};  ///< of smoothed tets, by vertex
  OffsetContact pairs{input.model};
};
/// A run from `start`, whose positions and velocities are of one instant. Throws Error for compliances not above 0.
Leapfrog leapfrog(const ReferenceInput& input, const Compliances& compliances, const State& start, double h);
/// Takes `steps` steps of h. Throws Error when the state is not finite.
void advance(Leapfrog& run, long steps);
/// Positions and velocities of the same instant.
State make_state(Leapfrog& run);

/// A number from -1 to 1, the same as by libstdc++'s std::uniform_real_distribution, but with every standard library.
inline double draw_unit(std::mt19937& random) {
  const double low = double(random()), high = double(random());
  return 2 * ((low + high * 0x1p32) / 0x1p64) - 1;
}
/// The stiffness of the stiffest constraint, 1/s^2 (method.md eq. 34), with a share of its vertices' masses. It bounds
/// the largest eigenvalue of M^-1 K, but for the curvature of constraints.
double stiffest_constraint(const ReferenceInput& input, const Compliances& compliances, const Points& positions);

}  // namespace tetpbd
