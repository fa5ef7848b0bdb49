// The reference motion of a body with compliance in implicit steps of BDF2 (Curtiss and Hirschfelder 1952), each solved
// exactly (objective.h), with contact by an active set and Coulomb friction. It is independent of leapfrog.h, so that
// each checks the other, and cheaper where fast vibrations or damping would make explicit steps very short.
#pragma once

#include <vector>

#include "sim/reference/objective.h"
#include "sim/reference/reference.h"

namespace tetpbd {

/// A run in steps of `h`. It obeys the settings' gravity, ground, friction, damping and constraint_damping.
struct Implicit {
  ReferenceInput input;
  Compliances compliances;
  double h = 0;           ///< s
  State now, before;      ///< two instants, h apart
  std::vector<int> anew;  ///< steps of implicit Euler that a vertex still takes, at the start and after impacts
  std::vector<Touching> touching;  ///< at the end of the last step
  std::vector<double> time = {0};  ///< s, one number
  int most = 0;                    ///< Newton steps at most, with friction by the forces before; 0: to convergence
};
/// Throws Error for compliances not above 0.
Implicit implicit(const ReferenceInput& input, const Compliances& compliances, const State& start, double h);
/// Takes `steps` steps of h. Throws Error where one is not solved.
void advance(Implicit& run, long steps);
inline const State& make_state(const Implicit& run) { return run.now; }

}  // namespace tetpbd
