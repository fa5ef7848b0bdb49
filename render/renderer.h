// Draws bodies straight from the simulation's position buffer, plain or coloured by a value.
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

/// Values that vertices gather from items[offsets[v]] .. items[offsets[v + 1]], in that order. There are no items
/// where a value depends on its vertex alone.
struct VertexGather {
  Buffer offsets, items;
  Buffer values;  ///< floats by vertex, cofactors by vertex, or SurfaceCorner by corner
  explicit operator bool() const { return bool(values); }
};

/// The key light and its depth image of bodies and obstacles, which the GPU fits to them without readback.
struct Shadow {
  int size = 0, depth_size = 0;  ///< texels a side, as needed and as `depth` has them
  Buffer bounds, light;          ///< `light`: the uniform block
  Buffer centre;                 ///< a copy of the light's `centre` for readback
  Fence centre_copied;
  Texture depth;
  Texture planes;  ///< the light that arrives on planes, in maps beside each other
  int planes_size = 0, planes_count = 0;
  Framebuffer framebuffer;
  Sampler compared, plain;
};

/// Buffers, programs and the shadow map are made when first needed.
struct Renderer {
  TetMesh mesh;
  std::vector<std::size_t> bodies;  ///< the first vertex of each
  /// Of each body: corners of its triangles, the first and their number.
  struct Part {
    glm::ivec2 corners;
    bool sheet = false, hidden = false;
  };
  std::vector<Part> parts;
  glm::vec3 rest_low{0.0f}, rest_high{0.0f};
  std::map<std::string, Pass> passes;
  Recorder recorder;
  VertexArray vertex_array, surface_array, empty_array;
  Buffer view;             ///< the uniform block
  Buffer triangles, tets;  ///< indices
  Buffer shown_tets;       ///< the same, a point where the body is hidden
  Buffer shown_triangles;  ///< likewise, for picking; none where no body is hidden
  Buffer graph;            ///< edges' vertices
  Buffer tet_edges;        ///< of the tet that was shown last, likewise
  std::optional<std::uint32_t> edged_tet;
  Buffer arrow_vertices, contact_arrows;
  std::vector<std::string> contact_sizes;  ///< Pairs::sizes for which `contact_arrows` was made
  Buffer rest;                             ///< vec4: rest position and body
  Buffer materials;                        ///< Frame::materials
  Texture materials_texture;
  std::vector<glm::vec4> made_materials;  ///< for which `materials` was made
  CarriedSurface carried;                 ///< embedded surface of all bodies, or empty
  Buffer carried_vertices, carried_triangles;
  VertexArray carried_array;
  std::array<Texture, 5> carried_texels;
  VertexGather cofactors;  ///< cofactors of deformation gradients, by vertex (cofactors.comp)
  VertexGather corners;    ///< corners of the surface, three of each triangle (corners.comp)
  std::map<Colour, VertexGather> values;
  Buffer values_copy;  ///< for readback
  Fence values_copied;
  ObstacleSurfaces obstacles;
  Shadow shadow;
  Legend legend;
};

Renderer make_renderer(TetMesh mesh, std::vector<std::size_t> bodies = {});
Renderer make_renderer(const Model& model);
/// Draws a picture. Leaves framebuffer, viewport and scissor at the frame's, and depth test, blending and sRGB off.
void draw(Renderer& renderer, const Frame& frame);
/// Fills and binds the uniform blocks of the view and the light.
void bind_view(Renderer& renderer, const Frame& frame);
/// Sets a vertex attribute from a buffer, or to zeros if `buffer` is 0.
void attribute(GLuint index, GLuint buffer, GLint count, std::size_t stride, std::size_t offset,
               GLenum type = GL_FLOAT);
/// Sets the vertex attributes of all but the surface; `values` is a buffer by vertex, or 0.
void bind_vertices(Renderer& renderer, const Frame& frame, GLuint values = 0);
/// Puts the program or kernel of that name in use, which is compiled when first needed.
const Program& use(Renderer& renderer, const std::string& name);
Pass& kernel(Renderer& renderer, const std::string& name);
/// Dispatches a kernel over `count` items, in work-groups of 128.
void run_over(Renderer& renderer, Pass& pass, std::size_t count);
/// By body: neither drawn nor picked, nor in the light.
void hide_bodies(Renderer& renderer, const std::vector<bool>& hidden);
bool is_hidden(const Renderer& renderer, std::uint32_t vertex);
/// The vertices of the tets, of those that are shown, and the rest positions with bodies, made when first needed.
const Buffer& tet_buffer(Renderer& renderer);
const Buffer& shown_tet_buffer(Renderer& renderer);
const Buffer& rest_buffer(Renderer& renderer);
/// The centre of the bodies' bounds in a frame drawn with `follow`, once, some frames later; with `wait`, waits.
std::optional<glm::vec3> poll_centre(Renderer& renderer, bool wait = false);
/// The present values by vertex that colours show; empty if they show none. Waits for the GPU.
std::vector<float> read_values(Renderer& renderer, const Frame& frame);
/// The values by vertex of a frame drawn with `worst`, once, some frames later; with `wait`, waits.
std::optional<std::vector<float>> poll_values(Renderer& renderer, bool wait = false);
/// Fills `distances` (floats by vertex) with the distances of `positions` and `reference` over `size` (m). Both are
/// buffers of Position.
void measure_distances(Renderer& renderer, GLuint positions, GLuint reference, double size, Buffer& distances);
/// Compiles all programs in use again. Throws Error and keeps the old ones if one does not compile.
void reload_shaders(Renderer& renderer);

}  // namespace tetpbd
