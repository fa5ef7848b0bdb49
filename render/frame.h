// What a picture shows: how the bodies look, from where, with what around them.
#pragma once

#include <GL/glew.h>

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/camera.h"
#include "render/target.h"
#include "sim/sim.h"

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
  bool follow = false;   ///< the camera goes where the bodies go: poll_centre() says where they are
  double shrink = 0.15;  ///< tets: each towards its centre, 0..1
  double explode = 0;    ///< tets: away from the bodies' centre, as a part of their distance from it
  double cut = 1;    ///< tets: those whose centre at rest is below this part of the rest shape's extent ...
  int cut_axis = 0;  ///< ... along x, y, z (0, 1, 2)
  glm::vec3 body_colour{0.74f, 0.50f, 0.41f};  ///< sRGB; further bodies turn its hue
  /// Of each Colour: none, V/V0 - 1, L/L0 - 1, m/s.
  std::array<ColourRange, 4> ranges{{{}, {-0.2, 0.2}, {-0.2, 0.2}, {0, 5}}};

  ColourRange& range() { return ranges[std::size_t(colour)]; }
  const ColourRange& range() const { return ranges[std::size_t(colour)]; }
  bool has_scale() const { return legend && colour != Colour::plain; }
};

/// The cheapest picture: flat faces on one colour, and nothing else.
inline ViewOptions plain_view(ViewOptions view) {
  view.smooth_normals = view.shadow = view.grid = view.legend = view.backdrop = false;
  return view;
}

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
  std::optional<float> ground;    ///< height, metres
  std::vector<glm::vec4> planes;  ///< walls: dot(xyz, x) = w, xyz of unit length towards the bodies
  std::vector<std::uint32_t> pinned, grabbed;  ///< vertices shown as dots
  std::string caption;                         ///< upper left
  bool over = false;  ///< the bodies alone, into what is drawn already
  float opacity = 1;  ///< of the bodies
  GLuint target = 0;  ///< framebuffer with an sRGB colour format (Target has it) and depth
};

/// A picture of a simulation with its ground, walls and pinned vertices (infinite mass), all of the target.
Frame frame_of(const Sim& sim, const Camera& camera, const ViewOptions& options, const Target& target);

}  // namespace tetpbd
