// Fine surfaces that ride on the tets (sim/mesh/carry.h), drawn in place of the tets' boundary.
#pragma once

#include "render/renderer.h"

namespace tetpbd {

/// Whether this picture shows one: what shows triangles, cuts or numbers of what is simulated shows the tets.
bool shows_carried(const Renderer& renderer, const ViewOptions& options);
/// 16 bytes a vertex, and indices; when first asked for.
void make_carried(Renderer& renderer);
/// With its program in use; its cofactors are behind a barrier.
void draw_carried(Renderer& renderer, const Frame& frame, const Program& program, GLuint values);

}  // namespace tetpbd
