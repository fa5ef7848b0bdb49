// The key light's depth image of the bodies, fitted to where they are by the GPU itself (no read-back).
#pragma once

#include <optional>

#include "render/gl_objects.h"

namespace tetpbd {

struct Shadow {
  static constexpr int size = 1024;  ///< texels a side
  Buffer bounds, light;              ///< light: the uniform block
  Buffer centre;                     ///< a copy of its `centre`, on its way back
  Fence centre_copied;
  Texture depth;
  Framebuffer framebuffer;
  Sampler compared, plain;
};

void make_map(Shadow& shadow);
/// Bounds and projection, by the program in use, `kernel`. `limit`: centre and radius of what is worth a
/// shadow (a blown-up vertex must not take the whole map).
void fit(Shadow& shadow, const Program& kernel, GLuint positions, std::size_t vertices,
         const glm::vec4& limit);
/// Asks for the middle of the bounds just fitted, unless an earlier question is open.
void request_centre(Shadow& shadow);

}  // namespace tetpbd
