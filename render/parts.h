// The parts of a picture, which renderer.cpp draws together.
#pragma once

#include "render/carried.h"
#include "render/renderer.h"

namespace tetpbd {

/// The buffer of this frame's values by vertex, or 0 if it shows none; with `worst` also copies them for readback.
GLuint find_values(Renderer& renderer, const Frame& frame);
/// Binds what bodies are made of, for kernels and shaders that show values of tets.
void bind_materials(Renderer& renderer, const Frame& frame);
/// Finds the cofactors of the deformation gradients, by which the normals of an embedded surface turn.
void fill_cofactors(Renderer& renderer, const Frame& frame);
/// Finds the corners of the surface, three of each triangle.
void fill_corners(Renderer& renderer, const Frame& frame, GLuint values);
/// Draws to the image or, with `shadow`, to the shadow map.
void draw_bodies(Renderer& renderer, const Frame& frame, GLuint values, bool shadow);
/// Fits the light's projection to the bodies, on the GPU, if anything in this frame needs it.
void fit_light(Renderer& renderer, const Frame& frame);
void draw_shadow_map(Renderer& renderer, const Frame& frame, GLuint values);
void bind_shadows(const Shadow& shadow);
/// Finds the light that arrives on the first `count` planes, as finely as the picture needs it.
void light_planes(Renderer& renderer, const Frame& frame, int count);

}  // namespace tetpbd
