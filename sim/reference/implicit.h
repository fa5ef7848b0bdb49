// The right motion of a body with compliance by implicit steps: BDF2 (Curtiss and Hirschfelder 1952), each
// step solved exactly (objective.h), vertices kept out of half spaces by an active set, with Coulomb
// friction. Shares no line with leapfrog.h but the formulas of constraints: each checks the other. The
// cheaper one where vibrations or damping are so fast that explicit steps would have to be very short.
#pragma once

#include <vector>

#include "sim/reference/objective.h"
#include "sim/reference/reference.h"

namespace tetpbd {

/// A run in steps of `h`. Of the settings it takes gravity, ground, friction, damping and constraint_damping.
struct Implicit {
  ReferenceInput input;
  Compliances compliances;
  double h = 0;                    ///< s
  State now, before;               ///< two instants, h apart
  std::vector<int> anew;           ///< steps for which a vertex takes implicit Euler's, which know no instant
                                   ///< before: at the start, and after an impact
  std::vector<Touching> touching;  ///< now
  std::vector<double> time = {0};  ///< s, one number
  int most = 0;                    ///< Newton steps at most, each with the friction found so far; 0: to the end
};
/// Throws Error for compliances not above 0.
Implicit implicit(const ReferenceInput& input, const Compliances& compliances, const State& start, double h);
/// `steps` steps of h. Throws Error where one is not solved.
void advance(Implicit& run, long steps);
inline const State& make_state(const Implicit& run) { return run.now; }

}  // namespace tetpbd
