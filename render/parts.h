// The parts of a picture, which renderer.cpp puts together.
#pragma once

#include "render/carried.h"
#include "render/renderer.h"

namespace tetpbd {

/// The buffer of the values of this frame by vertex, found where they have to be, and their copy on its way
/// back; 0 where there are none.
GLuint find_values(Renderer& renderer, const Frame& frame);
/// What a fine surface needs beside the positions.
void fill_cofactors(Renderer& renderer, const Frame& frame);
/// The surface, three corners a triangle.
void fill_corners(Renderer& renderer, const Frame& frame, GLuint values);
/// To the image or, with `shadow`, to the map.
void draw_bodies(Renderer& renderer, const Frame& frame, GLuint values, bool shadow);
/// The projection of the light, as far as something of this frame needs it, fitted by the GPU itself.
void fit_light(Renderer& renderer, const Frame& frame);
void draw_shadow_map(Renderer& renderer, const Frame& frame, GLuint values);
void bind_shadows(const Shadow& shadow);
/// What light arrives on so many planes, as fine as the picture needs it.
void light_planes(Renderer& renderer, const Frame& frame, int count);

}  // namespace tetpbd
