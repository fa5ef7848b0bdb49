// The averages of smoothed tets on the GPU (rings.glsl, smooth.comp).
#pragma once

#include "sim/solvers/solver.h"

namespace tetpbd {

/// The block Rings of shaders/rings.glsl.
std::vector<glm::uvec4> ring_words(const Averages& averages);

/// Gives the solver the blocks Rings and Averages, and returns the pass that fills the latter from quantized positions.
Pass make_smoothing_pass(Solver& solver, const SolverInput& input);

}  // namespace tetpbd
