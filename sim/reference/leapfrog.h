// The right motion of a body with compliance, by explicit leapfrog in double at a step far below what its
// fastest vibration allows: no linear system, no iteration, no tolerance. Cheaper than an implicit step
// wherever a step of the scene takes fewer than some hundred of them. Vertices meet half spaces without
// bouncing, with Coulomb friction. Bodies meet each other as in modes on the CPU: right is what that comes to
// with ever shorter steps.
#pragma once

#include <random>
#include <vector>

#include "sim/contact/pair_contact.h"
#include "sim/parallel.h"
#include "sim/reference/objective.h"
#include "sim/reference/reference.h"

namespace tetpbd {

/// A run in steps of `h`. Of the settings it takes gravity, ground, friction, damping and constraint_damping.
struct Leapfrog {
  ReferenceInput input;
  Compliances compliances;
  double h = 0;                     ///< s
  Points x;                         ///< m, at the time reached
  Points v;                         ///< m/s, half a step before
  Points parts;                     ///< N, by constraint and vertex of it, all kinds one after the other
  Grouped at_vertex;                ///< which of them act on a vertex
  std::vector<double> time = {0};   ///< s, one number
  std::vector<State::Held> held{};  ///< as in State
  PairContact pairs{input.model};
};
/// From `start`, whose velocities are those of the same instant. Throws Error for compliances not above 0.
Leapfrog leapfrog(const ReferenceInput& input, const Compliances& compliances, const State& start, double h);
/// `steps` steps of h. Throws Error when the state is not finite.
void advance(Leapfrog& run, long steps);
/// Positions and velocities of the same instant.
State make_state(Leapfrog& run);

/// From -1 to 1. The numbers of libstdc++'s std::uniform_real_distribution, which others replace by their
/// own.
inline double draw_unit(std::mt19937& random) {
  const double low = double(random()), high = double(random());
  return 2 * ((low + high * 0x1p32) / 0x1p64) - 1;
}
/// The longest step that is stable about these positions, s: of the largest eigenvalue of M^-1 K, by power
/// iteration on differences of forces, and of constraint_damping. Bodies that deform far need less.
double stable_step(const ReferenceInput& input, const Compliances& compliances, const Points& positions,
                   int iterations = 100);

/// How stiff the stiffest constraint is, 1/s^2 (method.md eq. 39b): the largest eigenvalue of M^-1 K is at
/// most this where each has its part of its vertices' masses, but for what bends and turns.
double stiffest_constraint(const ReferenceInput& input, const Compliances& compliances, const Points& positions);

}  // namespace tetpbd
