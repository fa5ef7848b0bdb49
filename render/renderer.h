// Draws bodies straight from the simulation's position buffer, plain or coloured by error.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "render/frame.h"
#include "render/legend.h"
#include "render/obstacles.h"
#include "sim/gl/pass.h"
#include "sim/model/model.h"

namespace tetpbd {

/// What each vertex gathers, in fixed order: items[offsets[v] .. offsets[v + 1]); nothing where it has a
/// value alone.
struct VertexGather {
  Buffer offsets, items;
  Buffer values;  ///< a float by vertex; or all SurfaceCorner
  explicit operator bool() const { return bool(values); }
};

/// The key light's depth image of bodies and obstacles, fitted to where they are by the GPU (no read-back).
struct Shadow {
  int size = 0, depth_size = 0;  ///< texels a side, wanted and made
  Buffer bounds, light;          ///< light: the uniform block
  Buffer centre;                 ///< a copy of its `centre`, on its way back
  Fence centre_copied;
  Texture depth;
  Texture planes;  ///< what light arrives on each: maps beside each other
  int planes_size = 0, planes_count = 0;
  Framebuffer framebuffer;
  Sampler compared, plain;
};

/// Only what was once asked for exists: buffers, programs, the shadow map.
struct Renderer {
  TetMesh mesh;
  std::vector<std::size_t> bodies;  ///< the first vertex of each
  std::vector<glm::ivec2> sheets;   ///< corners of triangles, the first and how many, of each that has no tets
  glm::vec3 rest_low{0.0f}, rest_high{0.0f};
  std::map<std::string, Pass> passes;
  Recorder recorder;
  VertexArray vertex_array, surface_array, empty_array;
  Buffer view;             ///< the uniform block
  Buffer triangles, tets;  ///< indices
  Buffer graph;            ///< edges' vertices
  Buffer arrow_vertices, touches;
  std::vector<std::string> touches_sizes;  ///< ... these Pairs::sizes
  Buffer rest;                             ///< vec4: rest position and body
  CarriedSurface carried;                  ///< of all bodies, or empty
  Buffer carried_vertices, carried_triangles;
  VertexArray carried_array;
  std::array<Texture, 5> carried_texels;
  VertexGather cofactors;  ///< of deformation gradients, by vertex: cofactors.comp
  VertexGather corners;    ///< of the surface, three a triangle; values: corners.comp
  std::map<Colour, VertexGather> values;
  Buffer values_copy;  ///< on its way back
  Fence values_copied;
  ObstacleSurfaces obstacles;
  Shadow shadow;
  Legend legend;
};

Renderer make_renderer(TetMesh mesh, std::vector<std::size_t> bodies = {});
Renderer make_renderer(const Model& model);
/// Leaves framebuffer, viewport and scissor at the frame's; depth test, blending and sRGB encoding off.
void draw(Renderer& renderer, const Frame& frame);
/// Puts what shaders know of the view in place, without which nothing is drawn.
void bind_view(Renderer& renderer, const Frame& frame);
/// A vertex attribute of a buffer, or zeros where there is none.
void attribute(GLuint index, GLuint buffer, GLint count, std::size_t stride, std::size_t offset,
               GLenum type = GL_FLOAT);
/// The vertex attributes of all but the surface; `values` by vertex, 0: none.
void bind_vertices(Renderer& renderer, const Frame& frame, GLuint values = 0);
/// The program or kernel of that name, made when first asked for, in use.
const Program& use(Renderer& renderer, const std::string& name);
Pass& kernel(Renderer& renderer, const std::string& name);
/// Dispatches a kernel over so many items, in work-groups of 128.
void run_over(Renderer& renderer, Pass& pass, std::size_t count);
/// The tetrahedra's vertices, rest positions with bodies: made when first asked for.
const Buffer& tet_buffer(Renderer& renderer);
const Buffer& rest_buffer(Renderer& renderer);
/// The middle of the bodies' bounds in a frame drawn with `follow`, once, some frames later (`wait`: now).
std::optional<glm::vec3> poll_centre(Renderer& renderer, bool wait = false);
/// What colours show of each vertex, now; empty where they show nothing. Waits for the GPU.
std::vector<float> read_values(Renderer& renderer, const Frame& frame);
/// The values by vertex that a frame drawn with `worst` coloured, once, some frames later (`wait`: now).
std::optional<std::vector<float>> poll_values(Renderer& renderer, bool wait = false);
/// How far vertices are from where `answers` has them, over `size` (m): both buffers of Position;
/// `distances`, floats, is made.
void measure_distances(Renderer& renderer, GLuint positions, GLuint answers, double size, Buffer& distances);
/// Compiles what is in use again. Throws Error and keeps the old ones if one does not compile.
void reload_shaders(Renderer& renderer);

}  // namespace tetpbd
