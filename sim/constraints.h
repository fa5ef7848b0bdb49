// Constraint kinds, and the constraints of a mesh: one list a kind.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "sim/formulas.h"
#include "sim/settings.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Constraints of one kind: `arity` vertices and one rest value each (m, rad or m^3), from positions in
/// double.
struct ConstraintList {
  int arity = 0;
  std::vector<std::uint32_t> vertices;  ///< arity * count
  std::vector<double> rest;
  std::size_t count() const { return rest.size(); }
  void add(std::span<const std::uint32_t> vertex, double value) {
    vertices.insert(vertices.end(), vertex.begin(), vertex.end());
    rest.push_back(value);
  }
};

/// For whoever evaluates a constraint without a mesh.
inline constexpr std::uint32_t any_ids[4] = {0, 1, 2, 3};

// A kind is a formula in shaders/constraints/NAME.glsl, included in sim/formulas.h, and a row here: its name,
// arity (2 or 4), stiffness and compliance, the formula as C++, and how a mesh gives its constraints. Order
// is the order of projection in Gauss-Seidel.
struct Stretch {
  static constexpr const char* name = "stretch";
  static constexpr int arity = 2;
  static constexpr double Settings::*stiffness = &Settings::k_stretch;
  static constexpr double Settings::*compliance = &Settings::compliance_stretch;
  template <class real, class Math = glsl::LibraryMath>
  static auto evaluate(glm::vec<3, real>* x, real rest, const std::uint32_t* id = any_ids) {
    return Formulas<real, Math>{}.stretch(x, rest, id);
  }
  static void build(const TetMesh& mesh, ConstraintList& list);  ///< every edge of every tet
};
struct Bend {
  static constexpr const char* name = "bend";
  static constexpr int arity = 4;
  static constexpr double Settings::*stiffness = &Settings::k_bend;
  static constexpr double Settings::*compliance = &Settings::compliance_bend;
  template <class real, class Math = glsl::LibraryMath>
  static auto evaluate(glm::vec<3, real>* x, real rest, const std::uint32_t* id = any_ids) {
    return Formulas<real, Math>{}.bend(x, rest, id);
  }
  static void build(const TetMesh& mesh,
                    ConstraintList& list);  ///< every edge that two surface triangles share
};
struct Volume {
  static constexpr const char* name = "volume";
  static constexpr int arity = 4;
  static constexpr double Settings::*stiffness = &Settings::k_volume;
  static constexpr double Settings::*compliance = &Settings::compliance_volume;
  template <class real, class Math = glsl::LibraryMath>
  static auto evaluate(glm::vec<3, real>* x, real rest, const std::uint32_t* id = any_ids) {
    return Formulas<real, Math>{}.volume(x, rest, id);
  }
  static void build(const TetMesh& mesh, ConstraintList& list);  ///< every tet
};
using Kinds = std::tuple<Stretch, Bend, Volume>;
constexpr int kind_count = int(std::tuple_size_v<Kinds>);

/// Calls f(Kind{}, index) for every kind, in order.
template <class F>
void for_each_kind(F&& f) {
  [&]<std::size_t... I>(std::index_sequence<I...>) { (f(std::tuple_element_t<I, Kinds>{}, int(I)), ...); }
  (std::make_index_sequence<std::size_t(kind_count)>{});
}

struct ConstraintKind {
  const char* name;
  int arity;
  double Settings::*stiffness, Settings::*compliance;
};
const std::vector<ConstraintKind>& constraint_kinds();

/// Whether constraints are XPBD's (method.md eq. 25): any kind in use has compliance, or there is damping.
bool compliant(const Settings& settings);
/// Whether constraints resist their rate.
bool damped(const Settings& settings);

/// The constraints of a mesh of the kinds that `names` ("stretch,volume") lists.
struct ConstraintSystem {
  std::vector<ConstraintList> lists;     ///< one per kind, empty for a kind left out
  std::vector<bool> present;             ///< by kind
  std::vector<std::uint32_t> at_vertex;  ///< n_i, constraints of all kinds on vertex i
  std::size_t count() const;
};
ConstraintSystem build_constraints(const TetMesh& mesh, const std::string& names);

}  // namespace tetpbd
