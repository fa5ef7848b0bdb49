// The table of constraint kinds. A kind is a formula in shaders/constraints/NAME.glsl, which CMake finds, and a row
// here, from which follow its stiffness k_NAME, its compliance compliance_NAME (unless users have no say in it),
// its kernels and its CPU loops. Gauss-Seidel projects the kinds in the order of the rows.
#pragma once

#include <array>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/model/formulas.h"

namespace tetpbd {

/// Vertex numbers for callers that evaluate a constraint without a mesh.
inline constexpr std::uint32_t any_ids[4] = {0, 1, 2, 3};

/// The vertices of every edge that two triangles of the surface share: both wings, then the ends of the edge.
std::vector<std::array<std::uint32_t, 4>> hinges(const TetMesh& mesh);

struct ConstraintKind {
  const char* name;
  int arity;                    ///< vertices, 2 or 4
  const char* noun;             ///< what the constraints hold, as help texts call it
  const char* compliance_unit;  ///< of unit(C)^2 / J
  double most_compliance = 1;   ///< the largest that settings accept; 0: they have no say in this kind
  int values = 1;               ///< numbers that describe a constraint at rest
  int components = 1;           ///< values of C, solved together, each with a compliance of its own
  bool curved = false;          ///< its Hessian has more than grad C grad C^T: NAME_curvature(), or NAME_part() of two
  bool tet = false;             ///< has NAME_jacobian(), the volume over that at rest
  bool averaged = false;        ///< its last C is by averages around its vertices (averages.h)
  bool rate = false;            ///< only C's change counts: the compliance is 1 / its damping, unit(C)^2 / (J s)
  bool driven = false;          ///< the last rest value is the number of an activation that the one before loses
  constexpr bool of_material() const { return most_compliance == 0; }
};

/// The kinds by number, in the order of their rows.
template <int>
struct KindAt;
constexpr int first_kind = __COUNTER__ + 1;
#define ADD_KIND(Kind)                      \
  template <>                               \
  struct KindAt<__COUNTER__ - first_kind> { \
    using type = Kind;                      \
  };

/// evaluate(positions, rest, vertex numbers) of a row, by its formula; `rest` is a number or points to several.
#define FORMULA(name)                                                                        \
  template <class real, class Math = glsl::LibraryMath>                                      \
  static auto evaluate(glm::vec<3, real>* x, auto rest, const std::uint32_t* id = any_ids) { \
    return Formulas<real, Math>{}.name(x, rest, id);                                         \
  }

/// A row of kinds that no mesh alone has: attachments.cpp and material.cpp add their constraints.
template <std::size_t values>
struct OfNoMesh {
  static std::vector<Tet> vertices(const TetMesh&) { return {}; }
  static std::array<double, values> rest(glm::dvec3*) { return {}; }
};

// A row says what the kind is called, its formula, the vertices of every constraint, and what these measure at rest.
struct Stretch {
  static constexpr ConstraintKind row{
      .name = "stretch", .arity = 2, .noun = "edges", .compliance_unit = "m/N", .curved = true};
  FORMULA(stretch)
  static auto vertices(const TetMesh& mesh) { return tet_edges(mesh); }
  static double rest(glm::dvec3* x) { return evaluate(x, 0.0).C; }
};
ADD_KIND(Stretch)
struct Bend {
  static constexpr ConstraintKind row{"bend", 4, "hinges", "rad^2/J", 1e4};
  FORMULA(bend)
  static auto vertices(const TetMesh& mesh) { return hinges(mesh); }
  // Not the formula's C: its clamp to 1 rad is for errors, not for rest angles.
  static double rest(glm::dvec3* x) { return Formulas<double>{}.hinge_angle(x); }
};
ADD_KIND(Bend)
struct Volume {
  static constexpr ConstraintKind row{
      .name = "volume", .arity = 4, .noun = "tets' volumes", .compliance_unit = "m^3/Pa", .tet = true};
  FORMULA(volume)
  static const auto& vertices(const TetMesh& mesh) { return mesh.tets; }
  static double rest(glm::dvec3* x) { return evaluate(x, 0.0).C; }
};
ADD_KIND(Volume)
struct NeoHookean {
  static constexpr ConstraintKind row{.name = "neo_hookean",
                                      .arity = 4,
                                      .noun = "tets",
                                      .compliance_unit = "1/J",
                                      .most_compliance = 0,
                                      .values = 8,
                                      .components = 2,
                                      .curved = true,
                                      .tet = true};
  FORMULA(neo_hookean)
  static const auto& vertices(const TetMesh& mesh) { return mesh.tets; }
  static std::array<double, 8> rest(glm::dvec3* x);  // the last is alpha, which material.cpp sets
};
ADD_KIND(NeoHookean)
struct Smoothed {
  static constexpr ConstraintKind row = [] {
    ConstraintKind row = NeoHookean::row;
    row.name = "smoothed", row.noun = "smoothed tets", row.averaged = true;
    return row;
  }();
  FORMULA(smoothed)
  static const auto& vertices(const TetMesh& mesh) { return mesh.tets; }
  static std::array<double, 8> rest(glm::dvec3* x) { return NeoHookean::rest(x); }
};
ADD_KIND(Smoothed)
struct Dashpot {
  static constexpr ConstraintKind row{
      .name = "dashpot", .arity = 2, .noun = "edges", .compliance_unit = "m/(N s)", .most_compliance = 0, .rate = true};
  FORMULA(dashpot)
  static auto vertices(const TetMesh& mesh) { return tet_edges(mesh); }
  static double rest(glm::dvec3* x) { return evaluate(x, 0.0).C; }
};
ADD_KIND(Dashpot)
struct Isobend {
  static constexpr ConstraintKind row{.name = "isobend",
                                      .arity = 4,
                                      .noun = "curvatures across hinges",
                                      .compliance_unit = "1/J",
                                      .most_compliance = 1e8,
                                      .values = 4};
  FORMULA(isobend)
  static auto vertices(const TetMesh& mesh) { return hinges(mesh); }
  static std::array<double, 4> rest(glm::dvec3* x);
};
ADD_KIND(Isobend)
struct Attach : OfNoMesh<5> {
  static constexpr ConstraintKind row{.name = "attach",
                                      .arity = 4,
                                      .noun = "attached vertices",
                                      .compliance_unit = "m/N",
                                      .most_compliance = 0,
                                      .values = 5};
  FORMULA(attach)
};
ADD_KIND(Attach)
struct Fibre : OfNoMesh<5> {
  static constexpr ConstraintKind row{.name = "fibre",
                                      .arity = 4,
                                      .noun = "fibres through tets",
                                      .compliance_unit = "1/J",
                                      .most_compliance = 0,
                                      .values = 5,
                                      .curved = true,
                                      .driven = true};
  FORMULA(fibre)
};
ADD_KIND(Fibre)
struct Viscous : OfNoMesh<2> {
  static constexpr ConstraintKind row{.name = "viscous",
                                      .arity = 4,
                                      .noun = "rates of strain of tets",
                                      .compliance_unit = "1/(J s)",
                                      .most_compliance = 0,
                                      .values = 2,
                                      .rate = true};
  FORMULA(viscous)
};
ADD_KIND(Viscous)
// The next row goes here.

template <int... I>
std::tuple<typename KindAt<I>::type...> list_kinds(std::integer_sequence<int, I...>);
using Kinds = decltype(list_kinds(std::make_integer_sequence<int, __COUNTER__ - first_kind>()));

/// A constraint's rest values as its formula takes them: the number, or a pointer to several.
template <class Kind, class real>
auto rest_values(const real* values) {
  if constexpr (Kind::row.values == 1)
    return *values;
  else
    return values;
}
/// Component k of what a formula returns: C, and a pointer to its gradients by vertex.
template <class Constraint>
auto component(const Constraint& c, int k) {
  if constexpr (std::is_array_v<decltype(c.C)>)
    return std::pair(c.C[k], &c.gradient[k][0]);
  else
    return std::pair(c.C, &c.gradient[0]);
}

constexpr std::size_t kind_count = std::tuple_size_v<Kinds>;

/// Calls f(Kind{}, index) for every kind, in order.
template <class F>
constexpr void for_each_kind(F&& f) {
  int index = 0;
  std::apply([&](auto... kind) { (f(kind, index++), ...); }, Kinds());
}

template <template <class> class Of, class... Kind>
std::tuple<Of<Kind>...> of_each(std::tuple<Kind...>);
/// The tuple of Of<Kind> for every kind.
template <template <class> class Of>
using OfEachKind = decltype(of_each<Of>(Kinds()));

/// A kind's number in the table and in the settings' arrays.
template <class Kind>
constexpr std::size_t index_of = [] {
  std::size_t index = 0;
  for_each_kind([&](auto kind, int k) {
    if (std::is_same_v<decltype(kind), Kind>) index = std::size_t(k);
  });
  return index;
}();

/// The rows of the table.
inline constexpr std::array<ConstraintKind, kind_count> constraint_kinds =
    std::apply([](auto... kind) { return std::array{decltype(kind)::row...}; }, Kinds());

}  // namespace tetpbd
