// What a simulation starts from: one rest mesh of all bodies, masses, start positions and velocities.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/contact/obstacle.h"
#include "sim/mesh/carry.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/model/settings.h"

namespace tetpbd {

/// State on the CPU, in double: what CPU modes step and what tests compare.
struct State {
  std::vector<glm::dvec3> positions;   ///< m
  std::vector<glm::dvec3> velocities;  ///< m/s
  /// The triangle that a vertex was in last, if any, and on which side of a sheet it belongs.
  struct Held {
    std::uint32_t target = ~0u, under = 0;
  };
  std::vector<Held> held{};  ///< by vertex of a surface, of CPU modes where bodies touch
};

/// A contiguous part of the rest mesh, and what it is made of.
struct Body {
  std::string name;
  std::size_t first_vertex = 0, vertices = 0, first_tet = 0, tets = 0, first_triangle = 0, triangles = 0;
  bool one_piece = false;              ///< and so a rigid body, if it is hard
  std::optional<Material> material{};  ///< its own; none: that of the settings
  std::optional<double> friction{};    ///< its own, where an obstacle has none; none: the world's
  bool is_sheet() const { return tets == 0; }
};

struct Model {
  TetMesh rest;  ///< metres; bodies one after the other
  std::vector<Body> bodies;
  std::vector<double> inverse_masses;  ///< 1/kg, 0: fixed
  std::vector<double> masses;          ///< kg, also of fixed vertices
  std::vector<glm::dvec3> positions;   ///< m, where the run starts
  std::vector<glm::dvec3> velocities;  ///< m/s
  std::vector<Obstacle> obstacles;     ///< beside the ground
  double size = 1;                     ///< m, diagonal of the largest body at rest
  /// The number a vertex had when its body was added; what leaves the program is in that order.
  std::vector<std::uint32_t> original;
  /// Where a body has a fine surface: of all bodies, what is drawn and exported in place of `rest.surface`.
  CarriedSurface carried;
};

/// The body that has a vertex.
const Body& body_at(const Model& model, std::size_t vertex);
/// What the body is made of; `all`: the settings, for those without a material of their own.
inline const Material& body_material(const Body& body, const Material& all) {
  return body.material ? *body.material : all;
}
/// Whether bodies have materials of their own. Constraints then carry the numbers of theirs.
bool has_own_materials(const Model& model);
/// Whether `holds` is true of what any body is made of.
bool any_material(const Model& model, const Material& all, bool (*holds)(const Material&));
/// s, the most constraint_damping of any body.
double most_damping(const Model& model, const Material& all);
/// As the other, of what each body is made of; `where` is the body where it has a material of its own.
void check_settings(const Model& model, const Settings& settings);

/// Adds a body; `positions` are its start positions (same count as `mesh`), `fixed` its fixed vertices;
/// `mass_factors`, if not empty, multiply the masses of its vertices.
void add_body(Model& model, const std::string& name, const TetMesh& mesh, double density,
              const std::vector<glm::dvec3>& positions, const glm::dvec3& velocity, const glm::dvec3& spin,
              const std::vector<std::uint32_t>& fixed, const std::vector<double>& mass_factors = {});

/// Numbers each body's vertices along a Hilbert curve through its rest shape, so that neighbours in space are
/// neighbours in memory: a large mesh reads its positions from nearer caches. Tets and triangles keep their
/// order.
void renumber(Model& model);
/// Rows of a per-vertex list in the order of `original`.
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

/// Start positions that are not the rest shape: none, flatten, line, point, random, mirror, stretch:F,
/// squash:F, twist:DEGREES, jitter:F (moved by up to F of its size along each axis and turned by up to F of a
/// full turn), invert-one, coincident, fold. Throws Error for anything else.
void deform(std::vector<glm::dvec3>& positions, const TetMesh& rest, const std::string& how, unsigned seed);

}  // namespace tetpbd
