// Where bodies stand before the first step: none may be inside an obstacle, nor inside another body where bodies
// touch. What overlaps is moved apart by whole bodies, or refused.
#pragma once

#include <string>
#include <vector>

#include "sim/model/model.h"

namespace tetpbd {

/// Moves each body of `model` that starts inside an obstacle (as obstacles stand at time 0) or, with contact between
/// bodies, inside another by the shortest motion that frees it from everything, and returns these motions in order.
/// Bodies that touch are moved apart by their offset (surfaces.h), upwards where one lies on the other. Vertices that
/// are fixed inside an obstacle are bolted to it. Throws Error, which names both, where no motion of a whole body
/// helps: a body with fixed vertices is never moved.
std::vector<StartMotion> separate_starts(Model& model, const Settings& settings);

/// One line for the user: which body was moved out of what, how deep it was and how far it went.
std::string describe(const StartMotion& motion);

}  // namespace tetpbd
