// The key light's depth image of the bodies, fitted to where they are by the GPU itself (no read-back).
#pragma once

#include "render/handles.h"

namespace tetpbd {

struct Shadow {
  static constexpr int size = 1024;  ///< texels a side
  Program bounds_kernel, fit_kernel;
  Buffer bounds, light;  ///< light: the uniform block
  Texture depth;
  Framebuffer framebuffer;
  Sampler compared, plain;
};

/// Bounds and projection only; the explode view needs these also without a shadow.
void make_bounds(Shadow& shadow);
void make_map(Shadow& shadow);
/// `limit`: centre and radius of what is worth a shadow (a blown-up vertex must not take the whole map).
void fit(const Shadow& shadow, GLuint positions, std::size_t vertices, const glm::vec4& limit);

}  // namespace tetpbd
