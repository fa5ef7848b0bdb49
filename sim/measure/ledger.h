// The energy ledger of a run: where energy came from that nothing supplied (method.md, "How error is measured").
#pragma once

#include <optional>

#include "sim/model/model.h"

namespace tetpbd {

struct Measurement;

/// Joules, from the measurements of a run in order.
struct EnergyLedger {
  double start = 0;  ///< total of the first measurement
  double work = 0;   ///< done since then by obstacles that move and by hands that hold vertices
  double total = 0;  ///< of the last: kinetic, potential and elastic, as the mode's own steps have them
  /// The largest rise of the total less the work above its least value before. Zero where energy is only lost; a
  /// bounce, which turns elastic energy back into motion, is no rise. Corrections that have not converged leave more
  /// strain than the compliance says, which never comes back as motion: in such modes what rises without elastic energy
  /// counts as well, and the lesser of the two is created.
  double created = 0;
  double scale = 0;    ///< what `created` is relative to: all that the scene can turn into motion, and the work
  double highest = 0;  ///< potential energy so far: a deeper fall than the scale is made for makes it larger
  long step = 0;       ///< of the last measurement
  bool begun = false;
  std::optional<const char*> not_judged;  ///< why_not_judged(), found when it began
  double lowest = 0, lowest_motion = 0;   ///< least total so far, and least without elastic energy
  double rise = 0, rise_of_motion = 0;    ///< the largest above these
  double by_hand = 0, most_work = 0, reserve = 0, work_before = 0;

  /// What was there at the start and supplied since, less what is left: lost by damping, friction, inelastic contact
  /// and by the solver itself.
  double dissipated() const { return begun ? start + work - total : 0; }
  /// `created` over `scale`; 0 before anything is known.
  double relative() const { return scale > 0 ? created / scale : 0; }
};

void add_measurement(EnergyLedger& ledger, const Measurement& now, const Model& model, const Settings& settings);

/// Why energy that is created says nothing about the solver, in a few words; none where it does: the published way of
/// contact, and bodies of stiffness that start deformed.
std::optional<const char*> why_not_judged(const Model& model, const Settings& settings);

}  // namespace tetpbd
