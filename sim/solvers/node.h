// Patches of vertices, which gather all their constraints in one dispatch: of modes node and explicit.
#pragma once

#include "sim/solvers/jacobi.h"

namespace tetpbd {

/// Gives the solver two buffers of quantized positions, and patches as large as is best for the mesh.
Pass make_vertex_patch_pass(Solver& solver, const SolverInput& input, const char* shader, bool multipliers);

}  // namespace tetpbd
