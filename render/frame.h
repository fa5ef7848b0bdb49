// Describes a picture: how bodies look, the camera, and the surroundings.
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
/// The numbers are those of COLOUR_... in shaders/render/layout.glsl.
enum class Colour { plain, volume, stretch, velocity, energy, motion, patch, residual };
inline constexpr std::array colour_names{"plain",  "volume", "stretch", "velocity",
                                         "energy", "motion", "patch",   "residual"};
inline constexpr std::array cut_names{"x", "y", "z", "the view"};

struct ColourRange {
  double low = 0, high = 1;
};
/// The scale of a Colour and its labels.
struct ColourScale {
  const char *title, *unit;
  double factor = 1;       ///< a value of 1 in the unit
  ColourRange range{};     ///< the initial one
  double most = 1;         ///< end of a slider that begins at 10^-4 of it
  bool is_signed = false;  ///< with 0 in the middle
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
  bool follow = false;   ///< the camera follows the bodies, whose centre poll_centre() gives
  double shrink = 0.15;  ///< of tets towards their centres, 0..1
  double explode = 0;    ///< of tets away from the bodies' centre, as a part of their distance from it
  double cut = 1;        ///< a plane cuts off all beyond this part of the rest shape's extent along `cut_axis`; 1: none
  int cut_axis = 0;      ///< 0, 1, 2: x, y, z; 3: `cut_normal`
  glm::vec3 cut_normal{0, 0, 1};
  glm::vec3 body_colour{0.74f, 0.50f, 0.41f};                 ///< sRGB; further bodies turn its hue
  std::array<ColourRange, colour_names.size()> ranges = [] {  ///< of each Colour
    std::array<ColourRange, colour_names.size()> start;
    for (std::size_t i = 0; i < start.size(); ++i) start[i] = colour_scales[i].range;
    return start;
  }();
  bool contacts = false;       ///< dots on vertices that touch obstacles, arrows where bodies touch
  bool arrows = false;         ///< the displacements of some vertices by their velocities ...
  double arrow_seconds = 0.1;  ///< ... in this time
  bool worst = false;          ///< reads the values of all vertices back (poll_values)
  bool flattest = false;       ///< shows the flattest tet
  bool hold_range = false;     ///< else ranges follow the present values (fitted_range)

  ColourRange& range() { return ranges[std::size_t(colour)]; }
  const ColourRange& range() const { return ranges[std::size_t(colour)]; }
  bool is_cut() const { return cut < 1; }
  glm::vec3 cut_direction() const {
    return cut_axis > 2 ? cut_normal : glm::vec3(cut_axis == 0, cut_axis == 1, cut_axis == 2);
  }
  const ColourScale& scale() const { return colour_scales[std::size_t(colour)]; }
  bool has_scale() const { return legend && *scale().title; }
};

/// The cheapest picture: flat faces in front of one colour.
inline ViewOptions plain_view(ViewOptions view) {
  view.smooth_normals = view.shadow = view.grid = view.legend = view.backdrop = false;
  return view;
}

/// A viewport in pixels from the lower left, as in GL.
struct Viewport {
  int x = 0, y = 0, width = 640, height = 480;
};

struct Frame {
  GLuint positions = 0;          ///< buffer of Position
  GLuint velocities = 0;         ///< buffer of Velocity, only for Colour::velocity and arrows
  GLuint values = 0;             ///< buffer of floats by vertex, only for Colour::motion (measure_distances) and patch
  const Pairs* pairs = nullptr;  ///< contact between bodies, only for `contacts`
  /// By body, or one for all: energy_material(), with w for tet_residual; only for colours of tets' values.
  std::vector<glm::vec4> materials{glm::vec4(0)};
  Camera camera;
  Viewport viewport;
  ViewOptions options;
  std::optional<float> ground;                 ///< height, m
  std::shared_ptr<const Model> model;          ///< whose obstacles are drawn as they are at `time`; may be null
  double time = 0;                             ///< s
  int chosen_obstacle = -1;                    ///< of the model, shown in another colour
  std::vector<std::uint32_t> pinned, grabbed;  ///< vertices shown as dots
  std::vector<std::uint32_t> touching;         ///< vertices on obstacles, shown as dots through the body
  std::vector<std::uint32_t> worst;            ///< vertices shown as rings through the body
  std::optional<std::uint32_t> tet;            ///< whose edges are shown through the body
  std::string caption;                         ///< at the upper left
  bool over = false;                           ///< draws only the bodies, into a picture that is there already
  float opacity = 1;                           ///< of the bodies
  GLuint target = 0;                           ///< framebuffer with sRGB colour (as Target has) and depth
};

/// A picture of a simulation with its obstacles and pinned vertices (of infinite mass), which fills the target.
Frame make_frame(const Sim& sim, const Camera& camera, const ViewOptions& options, const Target& target);
/// Updates what changes from step to step: the time and the contacts.
void update(Frame& frame, const Sim& sim);

}  // namespace tetpbd
