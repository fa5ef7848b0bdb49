// Draws surfaces embedded in the tets (sim/mesh/carry.h) in place of the tets' boundary.
#pragma once

#include "render/renderer.h"

namespace tetpbd {

/// Whether a picture shows the embedded surface. Views of simulated triangles, cuts and patches show the tets instead.
bool shows_carried(const Renderer& renderer, const ViewOptions& options);
/// Makes its buffers: 16 bytes a vertex, and indices.
void make_carried(Renderer& renderer);
/// Draws it with `program` in use. `values` is a buffer of floats by vertex, or 0.
void draw_carried(Renderer& renderer, const Frame& frame, const Program& program, GLuint values);

}  // namespace tetpbd
