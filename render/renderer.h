// Draws bodies straight from the simulation's position buffer: surface, wire, or tetrahedra; in plain or by
// error.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/camera.h"
#include "render/legend.h"
#include "render/shadow.h"
#include "render/vertex_data.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

enum class Look { surface, wire, tets };
enum class Colour { plain, volume, stretch, velocity };  // COLOUR_... of shaders/render/layout.glsl
inline constexpr std::array look_names{"surface", "wire", "tets"};
inline constexpr std::array colour_names{"plain", "volume", "stretch", "velocity"};

struct ColourRange {
  double low = 0, high = 1;
};

struct ViewOptions {
  Look look = Look::surface;
  Colour colour = Colour::plain;
  bool smooth_normals = true;
  bool shadow = true;
  bool grid = true;      ///< lines on the ground and on walls
  bool backdrop = true;  ///< sky, ground and walls; without: one colour
  bool legend = true;    ///< drawn with every colour but plain
  double shrink = 0.15;  ///< tets: each towards its centre, 0..1
  double explode = 0;    ///< tets: away from the bodies' centre, as a part of their distance from it
  double cut =
      1;  ///< tets: only those whose centre at rest is below this part of the rest shape's extent ...
  int cut_axis = 0;                            ///< ... along x, y, z (0, 1, 2); 1 cuts nothing
  glm::vec3 body_colour{0.74f, 0.50f, 0.41f};  ///< sRGB; further bodies turn its hue
  ColourRange volume{-0.2, 0.2};               ///< V/V0 - 1
  ColourRange stretch{-0.2, 0.2};              ///< L/L0 - 1
  ColourRange velocity{0, 5};                  ///< m/s
};

/// The cheapest picture: flat faces on one colour, and nothing else.
inline ViewOptions plain_view(ViewOptions view) {
  view.smooth_normals = view.shadow = view.grid = view.legend = view.backdrop = false;
  return view;
}

/// Vertices of one of several bodies in one mesh.
struct BodyRange {
  std::uint32_t first = 0, count = 0;
};

/// Pixels from the lower left, as in GL.
struct Viewport {
  int x = 0, y = 0, width = 640, height = 480;
};

struct Frame {
  GLuint positions = 0;   ///< buffer of Position; nothing but its current state is read
  GLuint velocities = 0;  ///< buffer of Velocity; needed for Colour::velocity alone
  Camera camera;
  Viewport viewport;
  ViewOptions options;
  std::optional<float> ground;        ///< height, metres
  std::span<const glm::vec4> planes;  ///< walls: dot(xyz, x) = w, xyz of unit length towards the bodies
  std::span<const std::uint32_t> pinned, grabbed;  ///< vertices shown as dots
  std::string caption;                             ///< upper left
  GLuint target = 0;  ///< framebuffer with an sRGB colour format (Target has it) and depth
};

/// Only what was once asked for exists: buffers, programs, the shadow map.
struct Renderer {
  TetMesh mesh;
  std::vector<BodyRange> bodies;
  glm::vec3 rest_low{0.0f}, rest_high{0.0f};
  VertexArray vertex_array, empty_array;
  Buffer view;             ///< the uniform block
  Buffer triangles, tets;  ///< indices
  Buffer rest;             ///< vec4: rest position and body
  Buffer dots;             ///< indices
  VertexGather normals, volume_errors, stretch_errors;
  Shadow shadow;
  std::optional<Legend> legend;
  Program surface, surface_shadow, tets_body, tets_shadow, background, plane, dot;
};

Renderer make_renderer(TetMesh mesh, std::vector<BodyRange> bodies = {});
/// Leaves framebuffer, viewport and scissor at the frame's, depth test, blending and sRGB encoding off.
/// Storage bindings change.
void draw(Renderer& renderer, const Frame& frame);
/// Compiles what is in use again, after shaders changed. Throws Error and keeps the old ones if one does not
/// compile.
void reload_shaders(Renderer& renderer);

}  // namespace tetpbd
