// What the kernels of modes explicit and newton note of a step, which decides how many substeps the next ones
// take; the answer comes back some steps later, always as many, so that a run is the same every time.
#pragma once

#include <optional>
#include <vector>

#include "sim/carried.h"

namespace tetpbd {

struct Sim;

struct AdaptiveValues {
  // Mode explicit.
  double at_rest = 0;      ///< 1/s^2, the stiffest constraint there; 0: not in mode explicit
  double stiffening = 1;   ///< by how much shorter than at rest a substep is, because the body is stiffer
  double stiffer = 1;      ///< than at rest, by the last answer
  int calm_readbacks = 0;  ///< answers in a row that asked for longer substeps
  bool changed = false;    ///< substeps are others than in the last step
  int most_substeps = 0;   ///< of a step, since the start
  double noted_h = 0;      ///< s, the substep that the answer was noted in

  // Mode newton: the residual before the last iteration over that of Newton's start, and the length of the
  // first step of conjugate gradients, which is near 1 where the second level knows the body, small where it
  // is left out, and taken for 0 where a tet is inverted and for 0.05 where a part of a body turns by more
  // than 0.15 rad in a substep of the settings; the last answer, and the worst since the start.
  double residual = 0, largest_residual = 0, health = 1, least_health = 1;
  int substep_factor = 1;     ///< substeps for each one of the settings
  int refined_readbacks = 0;  ///< answers since they are more; too many: it does not help
};

constexpr int refined_substeps = 4;  ///< as many substeps

/// Part of a Sim (sim.h), whose solver keeps it up to date.
struct AdaptiveSubsteps : AdaptiveValues {
  static constexpr long every = 2;  ///< steps: from one question to the next, which brings its answer
  Buffer readback, nothing;         ///< of words of the kernels' block (vertex_state.glsl)
  Fence requested;
  AdaptiveSubsteps& operator=(const AdaptiveValues& numbers) {
    return static_cast<AdaptiveValues&>(*this) = numbers, *this;
  }
};

/// What kernels noted since it was last asked, and asks again; none the first time.
std::optional<std::vector<float>> poll_notes(Sim& sim);
/// The same in mode newton; whether there was an answer.
bool poll_convergence(Sim& sim);
/// As of the last step. Waits.
const AdaptiveSubsteps& adaptive_values(Sim& sim);
/// What kernels noted of other settings or another state.
void forget_readbacks(Sim& sim);
/// `words`: the kernels' block that holds what they noted.
void add_carried(Carried& all, AdaptiveSubsteps& watch, const Buffer& words);

/// By how much shorter a substep is, of `stability` times the longest stable at rest, where the stiffest
/// constraint is `stiffer` times as stiff as at rest: enough to stay within 0.7 of what is stable, in steps
/// of a quarter of an octave, at most 32.
double stiffening_for(double stiffer, double stability);

}  // namespace tetpbd
