// The model that a simulation starts from: one rest mesh of all bodies, masses, start positions and velocities.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/contact/obstacle.h"
#include "sim/mesh/carry.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/thickness.h"
#include "sim/model/settings.h"

namespace tetpbd {

/// With what impulse a pair of surfaces of hard bodies begins its next substep, and how large it was in the last.
struct WarmImpulse {
  glm::dvec3 impulse{0};  ///< kg m, of a velocity times the substep's length
  double size = 0;
};
/// Of two edges, or a vertex and a triangle, by their numbers (contact/surfaces.h).
struct PairImpulse {
  bool edges;
  std::uint32_t first, second;
  WarmImpulse warm;
};
/// The sum of a body's, over its mass.
struct Wrench {
  glm::dvec3 impulse{0}, turning{0}, about{0};  ///< m, m^2, m
};

/// The state on the CPU, in double: what CPU modes step and what tests compare.
struct State {
  std::vector<glm::dvec3> positions;    ///< m
  std::vector<glm::dvec3> velocities;   ///< m/s
  std::vector<double> work{};           ///< J that obstacles that move have done on each vertex; empty: none
  std::vector<PairImpulse> impulses{};  ///< of hard bodies that touch each other, in CPU modes
  std::vector<Wrench> wrenches{};       ///< of these by body, or empty
  std::vector<double> rest_metrics{};   ///< six numbers a tet, where any body yields; empty: as at the start
};

/// A contiguous part of the rest mesh.
struct Body {
  std::string name;
  std::size_t number = 0;  ///< in the model, and in Settings::bodies
  std::size_t first_vertex = 0, vertices = 0, first_tet = 0, tets = 0, first_triangle = 0, triangles = 0;
  bool one_piece = false;  ///< has no hinges, and so is a rigid body if it is hard and nothing but contact acts on it
  double thickness = 0;    ///< m, of a sheet
  bool is_sheet() const { return tets == 0; }
};

/// A body that started inside something, or touched another, and was moved before the run (contact/starts.h).
struct StartMotion {
  std::string body, from;  ///< its name, and what it was in; empty: it touched
  glm::dvec3 motion{0};    ///< m
  double work = 0;         ///< J, against gravity
};

/// Fixed vertices of a body that move.
struct Fixture {
  std::size_t body, region;  ///< of the model's bodies, and of what the scene fixes of this one
  std::vector<std::uint32_t> vertices;
  Path path;
};

/// What holds vertices of a body to the surface of another (attachments.h).
struct Attachment {
  std::size_t body, to;                 ///< of the model's bodies
  std::vector<std::uint32_t> vertices;  ///< of `body`
  std::vector<Triangle> triangles;      ///< of the other's surface, for each of them
  std::vector<glm::dvec3> places;       ///< weights of its second and third corner; m, along its normal
  double stiffness = 0;                 ///< N/m, of all together; 0: hard, by forces as stiff as the bodies there
  std::optional<double> break_force{};  ///< N, on all together, above which it lets go
};

/// A factor over time, linear between its points, the first and last before and after them; none: 1.
using FactorOverTime = std::vector<std::pair<double, double>>;
double factor_at(const FactorOverTime& factors, double time);

/// s, of the step that begins at `time`: when its loads and activations are taken. Implicit steps take them at their
/// end.
double time_of_loads(const Settings& settings, double time);

/// What pulls or presses vertices beside gravity (loads.h).
struct Load {
  enum class Kind { acceleration, pressure, wind };
  Kind kind = Kind::acceleration;
  glm::dvec3 vector{0};                 ///< m/s^2, of wind m/s
  double amount = 0;                    ///< of pressure Pa, outwards; of wind kg/m^3, density of air times drag
  std::vector<std::uint32_t> vertices;  ///< pressure and wind act on triangles that have three of them
  FactorOverTime factors{};
};

/// Fibres through tets, along a direction at rest, which pull where they are longer than at rest. An activation of a
/// half asks for half the length.
struct Fibres {
  std::vector<std::uint32_t> tets;
  glm::dvec3 direction{1, 0, 0};  ///< of length 1
  double stiffness = 0;           ///< Pa, over the area across them
  FactorOverTime activation{};    ///< none: 0
};

/// How a body was made of its file.
struct BodyFill {
  std::size_t body;  ///< of the model's
  std::string what;  ///< was done that nobody asked for; empty: nothing
  Fit fit;           ///< at rest, in the frame of the scene
};

struct Model {
  TetMesh rest;  ///< m; bodies one after the other
  std::vector<Body> bodies;
  std::vector<double> inverse_masses;  ///< 1/kg, 0: fixed
  std::vector<double> masses;          ///< kg, also of fixed vertices
  std::vector<glm::dvec3> positions;   ///< m, where the run starts
  std::vector<glm::dvec3> velocities;  ///< m/s
  std::vector<Obstacle> obstacles;     ///< without the ground
  std::vector<Fixture> fixtures{};
  std::vector<Attachment> attachments{};
  std::vector<Load> loads{};
  std::vector<Fibres> fibres{};
  /// By tet: 0, or the number, from 1 on, of its body's region that has moduli of its own. Empty: no body has any.
  std::vector<std::uint8_t> regions{};
  double size = 1;  ///< m, diagonal of the largest body at rest
  /// The number a vertex had when its body was added; what leaves the program is in that order.
  std::vector<std::uint32_t> original;
  std::vector<BodyFill> fills;             ///< of bodies from files; others have none
  std::vector<StartMotion> start_motions;  ///< already made in `positions`
  /// The surface of all bodies that is drawn and exported in place of `rest.surface`; empty unless a body has its own.
  CarriedSurface carried;
};

/// The body to which a vertex belongs.
const Body& body_at(const Model& model, std::size_t vertex);
/// By vertex: how much finer its body's quanta are than those of the largest body, a power of two up to 1. Empty where
/// no body is smaller than an eighth of that, and where bodies touch or are attached: their corrections are sums of
/// common quanta.
std::vector<float> quantum_fineness(const Model& model, const Settings& settings);
double body_mass(const Model& model, const Body& body);  ///< kg
double mean_edge(const Model& model, const Body& body);  ///< m, of its surface at rest
/// The body's part of the rest mesh, by itself: its vertices are numbered from 0.
TetMesh body_mesh(const Model& model, const Body& body);
/// Bounds of the body's vertices, given the positions of all.
Bounds body_bounds(const Body& body, const std::vector<glm::dvec3>& positions);
/// check_settings() of settings.h with what each body has of its own; errors name the body.
void check_settings(const Model& model, const Settings& settings);

/// Adds a body. `positions` (m) are its start positions, as many as the mesh has; `density` is in kg/m^3, `spin` in
/// rad/s; `fixed` are its fixed vertices; `mass_factors`, if there are any, multiply the masses of its vertices.
void add_body(Model& model, const std::string& name, const TetMesh& mesh, double density,
              const std::vector<glm::dvec3>& positions, const glm::dvec3& velocity, const glm::dvec3& spin,
              const std::vector<std::uint32_t>& fixed, const std::vector<double>& mass_factors = {});

/// Numbers each body's vertices along a Hilbert curve through its rest shape. Neighbours in space are then neighbours
/// in memory, and a large mesh finds its positions in nearer caches. Tets and triangles keep their order.
void renumber(Model& model);
/// The rows of a list by vertex, in the order of `original`.
template <class T>
std::vector<T> in_original_order(const Model& model, const std::vector<T>& rows) {
  std::vector<T> result(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) result[model.original[i]] = rows[i];
  return result;
}
/// Tets or triangles with the vertices' original numbers.
template <class Elements>
Elements in_original_numbers(const Model& model, Elements elements) {
  for (auto& element : elements)
    for (std::uint32_t& v : element) v = model.original[v];
  return elements;
}
inline std::vector<Tet> original_tets(const Model& model) { return in_original_numbers(model, model.rest.tets); }

/// Deforms positions by name: none, flatten, line, point, random, mirror, stretch:F, squash:F, twist:DEGREES, jitter:F
/// (moved by up to F of the size along each axis and turned by up to F of a full turn), invert-one, coincident, fold.
/// Throws Error for anything else.
void deform(std::vector<glm::dvec3>& positions, const TetMesh& rest, const std::string& how, unsigned seed);

}  // namespace tetpbd
