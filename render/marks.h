// What is drawn over bodies: dots on pinned, grabbed, touching vertices, rings on the worst, arrows of
// velocity.
#pragma once

#include "render/renderer.h"

namespace tetpbd {

/// With the view's blocks and the bodies' attributes bound, depth test and blending on; leaves the depth test
/// off.
void draw_marks(Renderer& renderer, const Frame& frame);

}  // namespace tetpbd
