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

enum class Look { surface, wire, tets, graph };
inline constexpr std::array look_names{"surface", "wire", "tets", "graph"};
/// COLOUR_... of shaders/render/layout.glsl.
enum class Colour { plain, volume, stretch, velocity, energy, motion, patch, residual };
inline constexpr std::array colour_names{"plain",  "volume", "stretch", "velocity",
                                         "energy", "motion", "patch",   "residual"};

inline constexpr std::array cut_names{"x", "y", "z", "the view"};

struct ColourRange {
  double low = 0, high = 1;
};
/// Of each Colour: how its scale is labelled, and how many of the unit a value of 1 is.
struct ColourScale {
  const char *title, *unit;
  double factor = 1;
  ColourRange range{};     ///< at first
  double most = 1;         ///< a slider's end, from a part in 10^4 of it
  bool is_signed = false;  ///< 0 in the middle
};
inline constexpr std::array<ColourScale, colour_names.size()> colour_scales{
    {{"", ""},
     {"Volume error", "% of rest", 100, {-0.2, 0.2}, 1, true},
     {"Edge strain", "% of rest", 100, {-0.2, 0.2}, 1, true},
     {"Speed", "m/s", 1, {0, 5}, 50},
     {"Elastic energy", "J/m\u00b3", 1, {0, 1e3}, 1e7},
     {"Error of motion", "% of size", 100, {0, 0.05}, 1},
     {"", ""},
     {"Constraint error", "% of rest", 100, {0, 0.1}, 1}}};

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
  double cut = 1;        ///< what is below this part of the rest shape's extent ...
  int cut_axis = 0;      ///< ... along x, y, z (0, 1, 2) or `cut_normal` (3) is shown, and where it ends a flat face
  glm::vec3 cut_normal{0, 0, 1};
  glm::vec3 body_colour{0.74f, 0.50f, 0.41f};                 ///< sRGB; further bodies turn its hue
  std::array<ColourRange, colour_names.size()> ranges = [] {  ///< of each Colour
    std::array<ColourRange, colour_names.size()> start;
    for (std::size_t i = 0; i < start.size(); ++i) start[i] = colour_scales[i].range;
    return start;
  }();
  bool contacts = false;       ///< dots where vertices touch the ground or walls
  bool arrows = false;         ///< where velocities take some of the vertices ...
  double arrow_seconds = 0.1;  ///< ... in this time
  bool worst = false;          ///< values of all vertices come back: poll_values()

  bool hold_range = false;  ///< else ranges follow the values of now (fitted_range)

  ColourRange& range() { return ranges[std::size_t(colour)]; }
  const ColourRange& range() const { return ranges[std::size_t(colour)]; }
  bool is_cut() const { return cut < 1; }
  glm::vec3 cut_direction() const {
    return cut_axis > 2 ? cut_normal : glm::vec3(cut_axis == 0, cut_axis == 1, cut_axis == 2);
  }
  const ColourScale& scale() const { return colour_scales[std::size_t(colour)]; }
  bool has_scale() const { return legend && *scale().title; }
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
  GLuint velocities = 0;  ///< buffer of Velocity; needed for Colour::velocity and arrows alone
  GLuint values = 0;      ///< buffer of floats by vertex; needed for Colour::motion (measure_distances) and patch alone
  const Pairs* pairs = nullptr;  ///< bodies that touch each other; needed for contacts alone
  glm::vec4 material{0};         ///< as tet_energy of values.glsl has it; needed for energy and residual alone
  Camera camera;
  Viewport viewport;
  ViewOptions options;
  std::optional<float> ground;                 ///< height, metres
  std::shared_ptr<const Model> model;          ///< whose obstacles are drawn, as they stand at `time`; none: none
  double time = 0;                             ///< s
  int chosen_obstacle = -1;                    ///< of the model; shown in another colour
  std::vector<std::uint32_t> pinned, grabbed;  ///< vertices shown as dots
  std::vector<std::uint32_t> touching;         ///< obstacles, also through the body
  std::vector<std::uint32_t> worst;            ///< as rings, also through the body
  std::string caption;                         ///< upper left
  bool over = false;                           ///< the bodies alone, into what is drawn already
  float opacity = 1;                           ///< of the bodies
  GLuint target = 0;                           ///< framebuffer with an sRGB colour format (Target has it) and depth
};

/// A picture of a simulation with its ground, walls and pinned vertices (infinite mass), all of the target.
Frame make_frame(const Sim& sim, const Camera& camera, const ViewOptions& options, const Target& target);
/// What changes from step to step: the time, and what touches.
void renew(Frame& frame, const Sim& sim);

}  // namespace tetpbd
