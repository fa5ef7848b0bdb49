// Draws marks over bodies: dots on pinned, grabbed and touching vertices, rings on the worst, a tet's
// edges, arrows of velocity.
#pragma once

#include "render/renderer.h"

namespace tetpbd {

/// Needs the view's blocks bound, depth test and blending on; leaves the depth test off.
void draw_marks(Renderer& renderer, const Frame& frame);

}  // namespace tetpbd
