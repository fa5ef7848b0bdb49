// What decides how many substeps the next steps of modes explicit and newton take. Kernels record it during a step,
// and the CPU reads it back always the same number of steps later, so that a run is the same every time.
#pragma once

#include <optional>
#include <vector>

#include "sim/carried.h"

namespace tetpbd {

struct Sim;

struct AdaptiveValues {
  // Mode explicit; `calm_readbacks` and `most_substeps` of both.
  double at_rest = 0;      ///< 1/s^2, of the stiffest constraint at rest (method.md eq. 34); 0 in other modes
  double stiffening = 1;   ///< how many times shorter a substep is than at rest, because the body is stiffer
  double stiffer = 1;      ///< how many times `at_rest` the stiffest constraint was at the last readback
  int calm_readbacks = 0;  ///< readbacks in a row after which fewer substeps would do
  bool changed = false;    ///< the number of substeps is not that of the last step
  int most_substeps = 0;   ///< of any step since the start
  double noted_h = 0;      ///< s, the length of a substep when values were last requested

  // Mode newton: the residual before the last iteration over that at Newton's start, and the length of the first step
  // of conjugate gradients: near 1 where the coarse level represents the body, small where it is missing. It counts
  // as 0 where a tet is inverted, as HEALTH_TURNING and HEALTH_FAST say (shaders/layout.glsl).
  double residual = 0, largest_residual = 0;  ///< at the last readback, and the largest since the start
  double health = 1, least_health = 1;        ///< the length of that first step, and the least since the start
  int substep_factor = 1;                     ///< substeps for each one of the settings
  int refined_readbacks = 0;                  ///< readbacks since there are more, to notice that they do not help
  int hard_readbacks = 0;                     ///< readbacks that Newton still takes two rounds
};

constexpr int refined_substeps = 4;  ///< the larger `substep_factor`

/// Part of a Sim (sim.h), whose solver keeps it up to date.
struct AdaptiveSubsteps : AdaptiveValues {
  static constexpr long every = 2;  ///< steps from one request to the next, which reads the last one back
  Buffer readback, nothing;         ///< two values of the kernels' block Check (vertex_state.glsl), and their start
  Fence requested;
  AdaptiveSubsteps& operator=(const AdaptiveValues& values) {
    return static_cast<AdaptiveValues&>(*this) = values, *this;
  }
};

/// Reads back what kernels recorded up to the last request, if there was one, and requests the next.
std::optional<std::vector<float>> poll_notes(Sim& sim);
/// The same in mode newton, into `adaptive`; whether anything was read back.
bool poll_convergence(Sim& sim);
/// As of the last step. Waits.
const AdaptiveSubsteps& adaptive_values(Sim& sim);
/// Drops what kernels recorded with other settings or from another state.
void forget_readbacks(Sim& sim);
/// `words`: the kernels' block Check.
void add_carried(Carried& all, AdaptiveSubsteps& adaptive, const Buffer& words);

/// How many times shorter than at rest a substep has to be where the stiffest constraint is `stiffer` times as stiff.
/// A substep at rest is `stability` times the longest stable one; the result keeps it within 0.9 of what is stable (or
/// `stability`, if that is larger), in steps of a quarter of an octave, at most 32.
double stiffening_for(double stiffer, double stability);

}  // namespace tetpbd
