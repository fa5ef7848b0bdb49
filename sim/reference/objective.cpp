#include "sim/reference/objective.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <cmath>
#include <limits>

namespace tetpbd {

namespace {

// Calls visit(Kind{}, vertex indices, positions relative to the first, rest values, alpha of each component)
// for every constraint with an energy.
template <class F>
void for_each_constraint(const Objective& o, const Points& positions, F&& visit) {
  for_each_elastic(o.system, o.compliances, [&](auto kind, const ConstraintList& list, auto&& alpha) {
    constexpr std::size_t arity = std::size_t(decltype(kind)::row.arity);
    std::array<glm::dvec3, arity> x;
    for (std::size_t c = 0; c < list.count(); ++c) {
      const std::uint32_t* vertices = list.vertices.data() + c * arity;
      for (std::size_t j = 0; j < arity; ++j) x[j] = positions[vertices[j]] - positions[vertices[0]];
      visit(kind, vertices, x, &list.rest[c * std::size_t(decltype(kind)::row.values)], alpha(c));
    }
  });
}

// E, and the sum of its terms' magnitudes: rounding is relative to that.
struct Energy {
  double value = 0, magnitude = 0;
};

Energy evaluate_energy(const Objective& o, const Points& positions) {
  Energy e;
  const auto add = [&](double term) { e.value += term, e.magnitude += std::abs(term); };
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const glm::dvec3 moved = positions[i] - o.predicted[i];
    add(0.5 * o.masses[i] * o.inertia * glm::dot(moved, moved));
    add(-o.masses[i] * glm::dot(o.gravity, moved));
  }
  for_each_constraint(o, positions,
                      [&](auto kind, const auto*, auto& x, const double* rest, const double* alpha) {
                        const auto c = unclamped<decltype(kind)>(x, rest);
                        for (int k = 0; k < kind.row.components; ++k) {
                          const double C = component(c, k).first;
                          add(C * C / (2 * alpha[k]));
                        }
                      });
  return e;
}

}  // namespace

double energy(const Objective& objective, const Points& positions) {
  return evaluate_energy(objective, positions).value;
}

Points gradient(const Objective& o, const Points& positions) {
  Points g(positions.size());
  for (std::size_t i = 0; i < g.size(); ++i)
    g[i] = o.masses[i] * (o.inertia * (positions[i] - o.predicted[i]) - o.gravity);
  for_each_constraint(o, positions,
                      [&](auto kind, const auto* v, auto& x, const double* rest, const double* alpha) {
                        const auto c = unclamped<decltype(kind)>(x, rest);
                        for (int k = 0; k < kind.row.components; ++k) {
                          const auto [C, of] = component(c, k);
                          for (std::size_t j = 0; j < x.size(); ++j) g[v[j]] += C / alpha[k] * of[j];
                        }
                      });
  return g;
}

// -------------------------------------------------------------------------------------------------------------
// Newton

namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Factor = Eigen::SimplicialLDLT<Sparse>;

// Of C^2 / (2 alpha), summed over components: (grad C grad C^T + C Hess C) / alpha. Hess C by central
// differences of the gradient over 1e-5 of the smallest side: truncation and rounding are both near 1e-10
// relative, and Newton converges with far worse.
template <class Kind, std::size_t arity>
auto constraint_hessian(std::array<glm::dvec3, arity>& x, const double* rest, const double* alpha,
                        bool project) {
  constexpr int n = 3 * int(arity);
  using Matrix = Eigen::Matrix<double, n, n>;
  using Vector = Eigen::Matrix<double, n, 1>;
  Matrix hessian = Matrix::Zero();
  const auto here = unclamped<Kind>(x, rest);
  // Sum of C grad C / alpha, with the C of `here`.
  const auto weighted = [&](const auto& c) {
    Vector sum = Vector::Zero();
    for (int k = 0; k < Kind::row.components; ++k)
      sum += component(here, k).first / alpha[k] * Eigen::Map<const Vector>(&component(c, k).second->x);
    return sum;
  };
  double side = std::numeric_limits<double>::max();
  for (std::size_t i = 0; i < arity; ++i)
    for (std::size_t j = 0; j < i; ++j) side = std::min(side, glm::length(x[i] - x[j]));
  const double step = 1e-5 * side;
  if (weighted(here) != Vector::Zero() && step > 0)
    for (int column = 0; column < n; ++column) {
      double& coordinate = x[std::size_t(column / 3)][column % 3];
      const double start = coordinate;
      coordinate = start + step;
      const double high = coordinate;
      hessian.col(column) = weighted(Kind::template evaluate<double>(x.data(), rest_of<Kind>(rest)));
      coordinate = start - step;
      hessian.col(column) -= weighted(Kind::template evaluate<double>(x.data(), rest_of<Kind>(rest)));
      hessian.col(column) /= high - coordinate;
      coordinate = start;
    }
  hessian = (0.5 * (hessian + hessian.transpose())).eval();
  for (int k = 0; k < Kind::row.components; ++k) {
    const Eigen::Map<const Vector> g(&component(here, k).second->x);
    hessian += g * g.transpose() / alpha[k];
  }
  if (project) {
    const Eigen::SelfAdjointEigenSolver<Matrix> modes(hessian);
    hessian = modes.eigenvectors() * modes.eigenvalues().cwiseMax(0).asDiagonal() *
              modes.eigenvectors().transpose();
  }
  return hessian;
}

// Lower triangle. A fixed vertex has rows of its own, which are the identity's. The pattern is the same at
// all positions.
Sparse assemble(const Objective& o, const Points& positions, bool project) {
  const int rows = 3 * int(positions.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < rows; ++row) {
    const double mass = o.masses[std::size_t(row / 3)];
    entries.emplace_back(row, row, mass > 0 ? mass * o.inertia : 1.0);
  }
  for_each_constraint(o, positions,
                      [&](auto kind, const auto* vertices, auto& x, const double* rest, const double* alpha) {
                        const auto local = constraint_hessian<decltype(kind)>(x, rest, alpha, project);
                        for (int r = 0; r < int(local.rows()); ++r)
                          for (int c = 0; c < int(local.cols()); ++c) {
                            const std::uint32_t to = vertices[r / 3], from = vertices[c / 3];
                            const int row = 3 * int(to) + r % 3, column = 3 * int(from) + c % 3;
                            if (row >= column && o.masses[to] > 0 && o.masses[from] > 0)
                              entries.emplace_back(row, column, local(r, c));
                          }
                      });
  Sparse hessian(rows, rows);
  hessian.setFromTriplets(entries.begin(), entries.end());
  return hessian;
}

// A pivot below 1e-14 of its diagonal entry is rounding.
bool positive_definite(Factor& factor, const Sparse& hessian) {
  factor.factorize(hessian);
  if (factor.info() != Eigen::Success) return false;
  const Eigen::VectorXd pivots = factor.vectorD(),
                        diagonal = factor.permutationP() * Eigen::VectorXd(hessian.diagonal());
  return (pivots.array() > 1e-14 * diagonal.array()).all();
}

// Factors the Hessian, or the nearest thing to it that is positive definite: with projected constraint
// Hessians, and if that is singular still, with a growing multiple of the mass matrix. `exact`: it was the
// Hessian itself.
bool factorise(Factor& factor, const Objective& o, const Points& positions, bool& exact) {
  Sparse hessian = assemble(o, positions, false);
  if (factor.cols() == 0) factor.analyzePattern(hessian);
  exact = positive_definite(factor, hessian);
  if (exact) return true;
  hessian = assemble(o, positions, true);
  Eigen::VectorXd masses(hessian.rows());
  for (Eigen::Index row = 0; row < masses.size(); ++row) masses(row) = o.masses[std::size_t(row / 3)];
  double shift = 1e-8 * Eigen::VectorXd(hessian.diagonal()).sum() / masses.sum();
  for (int attempt = 0; attempt <= 10; ++attempt, shift *= 100) {
    if (positive_definite(factor, hessian)) return true;
    hessian.diagonal() += shift * masses;
  }
  return false;
}

// Stiff bodies that turn far take hundreds of short steps, all others under 30.
constexpr int newton_limit = 1000;

Eigen::Map<Eigen::VectorXd> flat(Points& points) { return {&points[0].x, 3 * Eigen::Index(points.size())}; }

Minimum newton(const Objective& o, Points start) {
  Minimum result;
  Points& x = result.positions = std::move(start);
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!(o.masses[i] > 0)) x[i] = o.predicted[i];
  Factor factor;
  while (!result.converged) {
    Points g = gradient(o, x);
    for (std::size_t i = 0; i < x.size(); ++i)
      if (!(o.masses[i] > 0)) g[i] = glm::dvec3(0);
    bool exact = false;
    if (!factorise(factor, o, x, exact)) return result.reason = "the Hessian has no factors", result;
    const Eigen::VectorXd step = factor.solve(-flat(g));
    const double descent = flat(g).dot(step);  // < 0
    result.residual = std::sqrt(-descent / o.unit);
    result.converged = exact && result.residual <= minimum_tolerance;
    // The step at hand is taken even so: it squares what is left.
    if (!exact && result.residual <= 1e-4 * minimum_tolerance)
      return result.reason = "not a stable, isolated minimum", result;
    if (result.iterations == newton_limit) return result.reason = "too many Newton steps", result;
    // Armijo; the last steps lower E by less than its rounding, which is allowed for.
    const Energy before = evaluate_energy(o, x);
    const double rounding = 1e-14 * before.magnitude;
    Points trial = x;
    double t = 1;
    for (int halvings = 0;; ++halvings, t *= 0.5) {
      if (halvings == 60) return result.reason = "no step lowers the energy", result;
      flat(trial) = flat(x) + t * step;
      if (evaluate_energy(o, trial).value <= before.value + 1e-4 * t * descent + rounding) break;
    }
    x = std::move(trial);
    ++result.iterations;
  }
  return result;
}

}  // namespace

// Around the first vertex: far from the origin, positions have no digits left for small strains.
Minimum minimise(Objective o, Points start) {
  const glm::dvec3 origin = o.predicted.empty() ? glm::dvec3(0) : o.predicted[0];
  for (Points* list : {&o.predicted, &start})
    for (glm::dvec3& p : *list) p -= origin;
  Minimum result = newton(o, std::move(start));
  for (glm::dvec3& p : result.positions) p += origin;
  return result;
}

}  // namespace tetpbd
