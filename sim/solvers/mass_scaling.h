// Mass scaling of mode explicit (method.md, "Leapfrog: explicit"): vertices whose tets are small, and so
// stiff, get heavier, and a substep may be longer.
#pragma once

#include <vector>

#include "sim/reference/reference.h"

namespace tetpbd {

/// What was added; nothing where it would lengthen the longest step by less than 1.2 times.
struct MassScaling {
  double added = 0;          ///< kg
  double gain = 1;           ///< the longest step that is stable at rest over that without
  std::size_t vertices = 0;  ///< that are heavier
};
struct ScaledMasses : MassScaling {
  std::vector<double> masses;  ///< kg, by vertex
  double longest_step = 0;     ///< s, that is stable at rest with these masses
};
/// Adds at most settings.mass_scaling of the mass of any body. `iterations`: those of stable_step().
ScaledMasses scale_masses(const ReferenceInput& input, int iterations);

}  // namespace tetpbd
