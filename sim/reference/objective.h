// The elastic energy of constraints with compliance, in double, and its minimiser by Newton: what a step of
// implicit Euler or a body at rest amounts to (reference.h).
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "sim/model/constraints.h"

namespace tetpbd {

using Points = std::vector<glm::dvec3>;  ///< m, by vertex

/// alpha of each kind, in the order of Kinds: a constraint's energy is C^2 / (2 alpha), so alpha is in
/// unit(C)^2 / J. Stretch: m^2/J = m/N, one over a spring's stiffness; bend: rad^2/J; volume: m^6/J = m^3/Pa.
/// Above 0 where there are such constraints (rigid_step is the limit); infinity leaves the kind out. A
/// material's constraints have their own.
using Compliances = std::array<double, kind_count>;

/// What is minimised, in joules, over the positions x of vertices with mass:
///   E(x) = sum m_i (inertia/2 |x_i - y_i|^2 - gravity . (x_i - y_i)) + sum_c C_c(x)^2 / (2 alpha_c).
/// A hinge that has turned further than 1 rad counts in full: the clamp of bend.glsl is part of the solvers,
/// not of the energy. E has a kink where a hinge is half a turn from rest.
struct Objective {
  const ConstraintSystem& system;
  Compliances compliances;
  std::vector<double> masses{};  ///< kg; 0: fixed
  Points predicted{};            ///< y; of fixed vertices, where they are
  double inertia = 0;            ///< 1/s^2, 1 / h^2; 0: static
  glm::dvec3 gravity{0};         ///< m/s^2; 0 for a step, whose y has it already
  double unit = 1;               ///< J, what tolerances are relative to (`Minimum::residual`)
  /// Damping over a step: E += ((C - before)^2 per_step) / (2 alpha) of kinds of which only the change
  /// counts, and `damping` times that of the others, but of bodies with their own. Empty: none.
  std::vector<double> before{};      ///< by component (constraint_values)
  double damping = 0, per_step = 0;  ///< s; 1/s
  /// Each vertex with mass is kept in `plane_count` half spaces (n, d), n . x >= d; by vertex.
  std::vector<glm::dvec4> planes{};
  std::size_t plane_count = 0;
  const glm::dvec4& plane(std::size_t vertex, std::size_t p) const { return planes[vertex * plane_count + p]; }
  /// Resists moving along a plane: |t| force, where the way t from `from` is longer than `reach`, and
  /// smoothly below.
  struct Drag {
    std::uint32_t vertex;
    glm::dvec3 normal, from;
    double force, reach;  ///< N, m
  };
  std::vector<Drag> drags{};
};
/// C of every component of every constraint that has an energy or damping, in the order of `before`.
std::vector<double> constraint_values(const Objective& objective, const Points& positions);
double energy(const Objective& objective, const Points& positions);
/// dE/dx, newtons; of fixed vertices too, where it is the force they are held with.
Points gradient(const Objective& objective, const Points& positions);

/// C, without the clamp to +-1 that bend.glsl has, and its gradient. C = f(x) - rest, so a clamped one is
/// found by moving `rest` along: at most three times, as hinges turn by pi at most. A spring 1 m too long
/// gets the same C.
template <class Kind, class Positions>
auto unclamped(Positions& x, const double* rest) {
  auto c = Kind::template evaluate<double>(x.data(), rest_values<Kind>(rest));
  if constexpr (Kind::row.components == 1 && Kind::row.values == 1) {
    const double unit = c.C;
    if (unit == 1 || unit == -1) {
      double further = unit;
      for (int turns = 1; turns <= 3 && further == unit; ++turns) {
        further = Kind::template evaluate<double>(x.data(), *rest + turns * unit).C;
        c.C = turns * unit + further;
      }
    }
  }
  return c;
}
/// Calls visit(Kind{}, list, alpha) for every kind that has constraints and an energy, or `rates` too;
/// alpha(c) points to the compliances of the components of constraint c.
template <bool rates = false, class F>
void for_each_elastic(const ConstraintSystem& system, const Compliances& compliances, F&& visit) {
  for_each_kind([&](auto kind, int k) {
    constexpr std::size_t components = std::size_t(decltype(kind)::row.components);
    const ConstraintList& list = system.lists[std::size_t(k)];
    const double* all = &compliances[std::size_t(k)];
    const bool own = !list.compliance.empty();
    if constexpr (decltype(kind)::row.rate && !rates) return;
    if (list.count() == 0 || (!own && std::isinf(*all))) return;
    visit(kind, list, [&list, all, own](std::size_t c) { return own ? &list.compliance[c * components] : all; });
  });
}

/// A vertex on a plane, and what that pushes it with, N.
struct Touching {
  std::uint32_t vertex, plane;
  double force;
};
struct Minimum {
  Points positions;
  std::vector<Touching> touching;
  int iterations = 0;  ///< Newton steps taken
  /// Norm of the gradient g in the inverse Hessian, sqrt(g . H^-1 g / unit): a number without unit. In a step
  /// it bounds the RMS (by mass) distance to the minimiser over the body's size, as H >= M/h^2 but for
  /// springs in compression. |g| over a typical force would not do: with stiff constraints rounding alone
  /// makes forces larger than inertia's. Taken before the last step, which leaves about its square.
  double residual = 0;
  bool converged = false;   ///< residual <= minimum_tolerance, and the Hessian is positive definite
  const char* reason = "";  ///< why not
};
constexpr double minimum_tolerance = 1e-10;
/// A minimum of E, by Newton with an Armijo line search, among half spaces with an active set in each step
/// (Nocedal and Wright 2006, ch. 16); of several minima, the one that `start` leads to.
/// `most`: Newton steps, after which what there is counts as converged; 0: to convergence.
Minimum minimise(Objective objective, Points start, int most = 0);

}  // namespace tetpbd
