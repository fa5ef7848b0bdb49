// The elastic energy of constraints with compliance, in double, and its minimiser by Newton, which solves a step of an
// implicit integrator or finds a body's state of rest.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "sim/model/constraints.h"

namespace tetpbd {

using Points = std::vector<glm::dvec3>;  ///< m, by vertex

/// alpha by kind, in unit(C)^2 / J, as a constraint's energy is C^2 / (2 alpha): m/N of stretch (one over a spring's
/// stiffness), rad^2/J of bend, m^3/Pa of volume. It is above 0 where there are such constraints, infinity leaves the
/// kind out, and a material's constraints have their own.
using Compliances = std::array<double, kind_count>;

/// What is minimised, in joules, over the positions x of vertices with mass:
///   E(x) = sum m_i (inertia/2 |x_i - y_i|^2 - gravity . (x_i - y_i)) + sum_c C_c(x)^2 / (2 alpha_c).
/// The clamp of bend.glsl to 1 rad is part of the solvers, not of E, which has a kink where a hinge is half a turn off.
struct Objective {
  const ConstraintSystem& system;
  Compliances compliances;
  std::vector<double> masses{};  ///< kg; 0: fixed
  Points predicted{};            ///< y; the positions of fixed vertices
  double inertia = 0;            ///< 1/s^2, 1 / h^2; 0: static
  glm::dvec3 gravity{0};         ///< m/s^2; 0 for a step, whose y has it already
  double unit = 1;               ///< J, to which tolerances are relative (`Minimum::residual`)
  /// Damping adds (C - before)^2 per_step / (2 alpha) to E for kinds of which only the change counts, and that times
  /// `damping`, or the list's own, for the others.
  std::vector<double> before{};      ///< by component (constraint_values); empty: no damping
  double damping = 0, per_step = 0;  ///< s; 1/s
  /// Each vertex with mass stays in `plane_count` half spaces (n, d), n . x >= d; by vertex.
  std::vector<glm::dvec4> planes{};
  std::size_t plane_count = 0;
  const glm::dvec4& plane(std::size_t vertex, std::size_t p) const { return planes[vertex * plane_count + p]; }
  /// Friction along a plane has the energy |t| force where the slip t since `from` exceeds `reach`; below, it is
  /// smooth.
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
/// dE/dx, N; at fixed vertices it is the force that holds them.
Points gradient(const Objective& objective, const Points& positions);

/// A formula's result without the clamp of C to +-1 that bend.glsl has. As C = f(x) - rest, a clamped C is found by
/// moving `rest` along, at most three times since hinges turn by pi at most. Springs 1 m too long get the same C.
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
/// Calls visit(Kind{}, list, alpha) for every kind that has constraints and an energy, with `rates` also for those of
/// which only the change counts. alpha(c) points to the compliances of constraint c, by component.
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

/// A vertex on a plane.
struct Touching {
  std::uint32_t vertex, plane;
  double force;  ///< N, of the plane
};
struct Minimum {
  Points positions;
  std::vector<Touching> touching;
  int iterations = 0;  ///< Newton steps taken
  /// sqrt(g . H^-1 g / unit) before the last step, which leaves about its square. As H >= M/h^2 but for compressed
  /// springs, it bounds the RMS distance (by mass) to the minimiser over the size. |g| over a typical force would not
  /// do: with stiff constraints, forces by rounding alone exceed those of inertia.
  double residual = 0;
  bool converged = false;   ///< residual <= minimum_tolerance, and the Hessian is positive definite
  const char* reason = "";  ///< why it did not converge
};
constexpr double minimum_tolerance = 1e-10;
/// The minimum of E to which `start` leads, by Newton with an Armijo line search, with an active set of half spaces in
/// each step (Nocedal and Wright 2006, ch. 16). After `most` Newton steps, if not 0, it counts as converged.
Minimum minimise(Objective objective, Points start, int most = 0);

}  // namespace tetpbd
