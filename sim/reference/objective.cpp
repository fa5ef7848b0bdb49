#include "sim/reference/objective.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/reference/smoothed.h"

namespace tetpbd {

namespace {

glm::dvec3 drag_displacement(const Objective::Drag& drag, const Points& positions) {
  const glm::dvec3 moved = positions[drag.vertex] - drag.from;
  return moved - drag.normal * glm::dot(drag.normal, moved);
}

// The energy of a component of C: stiffness / 2 (C - offset)^2. By averages, of which vertices store what they resist,
// it has stiffness / 2 own^2 instead (smoothed.glsl).
struct Spring {
  double stiffness = 0, offset = 0;
  bool averaged = false;
  double own = 0;
};

Spring by_averages(double stiffness, const OwnVolume& own) {
  return {stiffness, own.excess, true, Formulas<double>{}.own_resistance(own.J)};
}

// Calls visit(Kind{}, vertex numbers, positions relative to the first, rest values, a Spring per component) for every
// constraint with an energy or damping.
template <class F>
void for_each_constraint(const Objective& o, const Points& positions, F&& visit) {
  std::size_t number = 0;  // of the component
  const std::vector<Average> averages = find_averages(o.system.averages, positions);
  for_each_elastic<true>(o.system, o.compliances, [&](auto kind, const ConstraintList& list, auto&& alpha) {
    constexpr ConstraintKind row = decltype(kind)::row;
    constexpr std::size_t arity = std::size_t(row.arity);
    const double elastic = row.rate ? 0 : 1;
    std::array<glm::dvec3, arity> x;
    std::array<Spring, std::size_t(row.components)> springs;
    for (std::size_t c = 0; c < list.count(); ++c) {
      const std::uint32_t* vertices = list.vertices.data() + c * arity;
      for (std::size_t j = 0; j < arity; ++j) x[j] = positions[vertices[j]] - positions[vertices[0]];
      const double damped = o.per_step * (row.rate ? 1 : list.damping_at(c, o.damping));
      for (std::size_t k = 0; k < springs.size(); ++k, ++number) {
        springs[k] = {(elastic + damped) / alpha(c)[k], 0};
        if (damped > 0) springs[k].offset = damped / (elastic + damped) * o.before[number];
      }
      if constexpr (row.averaged)
        springs[1] = by_averages(springs[1].stiffness, own_volume(x, vertices, list, c, averages));
      visit(kind, vertices, x, &list.rest[c * std::size_t(row.values)], springs);
    }
  });
}

// E, and the sum of its terms' magnitudes, to which rounding is relative.
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
  for_each_constraint(o, positions, [&](auto kind, const auto*, auto& x, const double* rest, auto& springs) {
    const auto c = unclamped<decltype(kind)>(x, rest);
    for (int k = 0; k < kind.row.components; ++k) {
      const Spring& s = springs[std::size_t(k)];
      const double C = s.averaged ? s.own : component(c, k).first - s.offset;
      add(s.stiffness / 2 * C * C);
    }
  });
  for_each_average(o.system.averages, positions,
                   [&](std::size_t, const Averages::Vertex& v, const Average& at) { add(average_energy(v, at)); });
  for (const Objective::Drag& drag : o.drags) {
    const double slip = glm::length(drag_displacement(drag, positions));
    add(drag.force * (slip < drag.reach ? slip * slip / (2 * drag.reach) : slip - drag.reach / 2));
  }
  return e;
}

}  // namespace

std::vector<double> constraint_values(const Objective& o, const Points& positions) {
  Objective undamped{o.system, o.compliances, {}, {}};
  std::vector<double> values;
  for_each_constraint(undamped, positions, [&](auto kind, const auto*, auto& x, const double* rest, auto&) {
    const auto c = unclamped<decltype(kind)>(x, rest);
    for (int k = 0; k < kind.row.components; ++k) values.push_back(component(c, k).first);
  });
  return values;
}

double energy(const Objective& o, const Points& positions) { return evaluate_energy(o, positions).value; }

Points gradient(const Objective& o, const Points& positions) {
  Points g(positions.size());
  for (std::size_t i = 0; i < g.size(); ++i)
    g[i] = o.masses[i] * (o.inertia * (positions[i] - o.predicted[i]) - o.gravity);
  for_each_constraint(o, positions, [&](auto kind, const auto* v, auto& x, const double* rest, auto& springs) {
    const auto c = unclamped<decltype(kind)>(x, rest);
    for (int k = 0; k < kind.row.components; ++k) {
      const auto [C, by_vertex] = component(c, k);
      const Spring& s = springs[std::size_t(k)];
      for (std::size_t j = 0; j < x.size(); ++j) g[v[j]] += s.stiffness * (C - s.offset) * by_vertex[j];
    }
  });
  const Points pull = average_forces(o.system.averages, find_averages(o.system.averages, positions));
  for (std::size_t i = 0; i < pull.size(); ++i) g[i] -= pull[i];
  for (const Objective::Drag& drag : o.drags) {
    const glm::dvec3 slip = drag_displacement(drag, positions);
    g[drag.vertex] += drag.force / std::max(glm::length(slip), drag.reach) * slip;
  }
  return g;
}

namespace {

using Sparse = Eigen::SparseMatrix<double>;
struct Factor : Eigen::SimplicialLDLT<Sparse> {
  Eigen::Index entries = -1;  // of the pattern that was analysed last
};

// The Hessian of s/2 (C - o)^2 is s (grad C grad C^T + (C - o) Hess C), summed over components. Hess C is found by
// central differences of the gradient over 1e-5 of the shortest side, where truncation and rounding are both about
// 1e-10 relative; Newton would converge with far less.
template <class Kind, std::size_t arity, class Springs>
auto constraint_hessian(std::array<glm::dvec3, arity>& x, const double* rest, const Springs& springs, bool project) {
  constexpr int n = 3 * int(arity);
  using Matrix = Eigen::Matrix<double, n, n>;
  using Vector = Eigen::Matrix<double, n, 1>;
  Matrix hessian = Matrix::Zero();
  const auto here = unclamped<Kind>(x, rest);
  // The sum of s (C - o) grad C, with the gradients of `c` and the C of `here`.
  const auto weighted = [&](const auto& c) {
    Vector sum = Vector::Zero();
    for (int k = 0; k < Kind::row.components; ++k)
      sum += springs[std::size_t(k)].stiffness * (component(here, k).first - springs[std::size_t(k)].offset) *
             Eigen::Map<const Vector>(&component(c, k).second->x);
    return sum;
  };
  const auto evaluate = [&] { return Kind::template evaluate<double>(x.data(), rest_values<Kind>(rest)); };
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
      hessian.col(column) = weighted(evaluate());
      coordinate = start - step;
      hessian.col(column) -= weighted(evaluate());
      hessian.col(column) /= high - coordinate;
      coordinate = start;
    }
  hessian = (0.5 * (hessian + hessian.transpose())).eval();
  for (int k = 0; k < Kind::row.components; ++k) {
    const Eigen::Map<const Vector> g(&component(here, k).second->x);
    if (!springs[std::size_t(k)].averaged || springs[std::size_t(k)].own != 0)
      hessian += springs[std::size_t(k)].stiffness * g * g.transpose();
  }
  if (project) {
    const Eigen::SelfAdjointEigenSolver<Matrix> modes(hessian);
    hessian = modes.eigenvectors() * modes.eigenvalues().cwiseMax(0).asDiagonal() * modes.eigenvectors().transpose();
  }
  return hessian;
}

// The lower triangle of the Hessian, with the identity's rows for fixed vertices. Its pattern is that of all positions.
Sparse assemble(const Objective& o, const Points& positions, bool project) {
  const int rows = 3 * int(positions.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < rows; ++row) {
    const double mass = o.masses[std::size_t(row / 3)];
    entries.emplace_back(row, row, mass > 0 ? mass * o.inertia : 1.0);
  }
  for_each_constraint(o, positions, [&](auto kind, const auto* vertices, auto& x, const double* rest, auto& springs) {
    const auto local = constraint_hessian<decltype(kind)>(x, rest, springs, project);
    for (int r = 0; r < int(local.rows()); ++r)
      for (int c = 0; c < int(local.cols()); ++c) {
        const std::uint32_t to = vertices[r / 3], from = vertices[c / 3];
        const int row = 3 * int(to) + r % 3, column = 3 * int(from) + c % 3;
        if (row >= column && o.masses[to] > 0 && o.masses[from] > 0) entries.emplace_back(row, column, local(r, c));
      }
  });
  for (std::size_t v = 0; v < o.system.averages.vertices.size(); ++v) {
    const AverageHessian average = average_hessian(o.system.averages, v, positions, project);
    for (std::size_t i = 0; i < average.slopes.size(); ++i)
      for (std::size_t j = 0; j < average.slopes.size(); ++j) {
        const std::uint32_t to = average.ids[i], from = average.ids[j];
        if (to < from || !(o.masses[to] > 0 && o.masses[from] > 0)) continue;
        const glm::dmat3 block = average.block(i, j);
        for (int r = 0; r < 3; ++r)
          for (int c = 0; c < 3; ++c)
            if (to > from || r >= c) entries.emplace_back(3 * int(to) + r, 3 * int(from) + c, block[c][r]);
      }
  }
  for (const Objective::Drag& drag : o.drags) {
    const glm::dvec3 slip = drag_displacement(drag, positions);
    const double length = glm::length(slip);
    glm::dmat3 local =
        drag.force / std::max(length, drag.reach) * (glm::dmat3(1) - glm::outerProduct(drag.normal, drag.normal));
    if (length > drag.reach) local -= drag.force / (length * length * length) * glm::outerProduct(slip, slip);
    const int first = 3 * int(drag.vertex);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c <= r; ++c) entries.emplace_back(first + r, first + c, local[c][r]);
  }
  Sparse hessian(rows, rows);
  hessian.setFromTriplets(entries.begin(), entries.end());
  return hessian;
}

// Factorises the matrix and says whether it is positive definite. A pivot below 1e-14 of its diagonal entry is
// rounding.
bool factorize(Factor& factor, const Sparse& matrix) {
  if (factor.entries != matrix.nonZeros()) factor.analyzePattern(matrix);
  factor.entries = matrix.nonZeros();
  factor.factorize(matrix);
  if (factor.info() != Eigen::Success) return false;
  const Eigen::VectorXd pivots = factor.vectorD(),
                        diagonal = factor.permutationP() * Eigen::VectorXd(matrix.diagonal());
  return (pivots.array() > 1e-14 * diagonal.array()).all();
}

Eigen::Map<Eigen::VectorXd> flat(Points& points) { return {&points[0].x, 3 * Eigen::Index(points.size())}; }

// The planes that hold vertices in a step from x.
struct ActiveSet {
  const Objective& o;
  const Points& x;
  std::vector<char> held;  // by vertex and plane
  double slack = 0;        // m, the largest distance that counts as none

  double gap(std::size_t i, std::size_t p, const glm::dvec3& moved) const {
    const glm::dvec4 plane = o.plane(i, p);
    return glm::dot(glm::dvec3(plane), x[i] + moved) - plane.w;
  }
  bool any() const { return std::ranges::find(held, 1) != held.end(); }
  // The projector onto the directions in which a vertex is free, and its displacement onto the planes that hold it.
  std::pair<glm::dmat3, glm::dvec3> freedom(std::size_t i) const {
    glm::dmat3 free(1);
    glm::dvec3 onto(0);
    for (std::size_t p = 0; p < o.plane_count; ++p) {
      if (!held[i * o.plane_count + p]) continue;
      const glm::dvec3 n(o.plane(i, p)), e = free * n;
      if (glm::dot(e, e) < 1e-12) continue;
      onto -= e * (gap(i, p, onto) / glm::dot(n, e));
      free -= glm::outerProduct(e, e) / glm::dot(e, e);
    }
    return {free, onto};
  }
  // Adds vertices that the step moves through a plane and drops those that their plane would pull at, by the `forces`
  // of planes on vertices. False if nothing changes.
  bool update(const Points& step, const Points& forces) {
    bool changed = false;
    for (std::size_t i = 0; i < x.size(); ++i)
      for (std::size_t p = 0; p < o.plane_count && o.masses[i] > 0; ++p) {
        char& now = held[i * o.plane_count + p];
        const char next = now ? glm::dot(glm::dvec3(o.plane(i, p)), forces[i]) > 0 : gap(i, p, step[i]) < -slack;
        changed = changed || next != now;
        now = next;
      }
    return changed;
  }
};

// The Hessian of steps in which held vertices move along their planes only.
Sparse constrain(const Sparse& hessian, const ActiveSet& set, Sparse& projector) {
  std::vector<Eigen::Triplet<double>> free, fixed;
  const double scale = hessian.diagonal().sum() / double(hessian.rows());
  for (std::size_t i = 0; i < set.x.size(); ++i) {
    const glm::dmat3 local = set.freedom(i).first;
    const int first = 3 * int(i);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        free.emplace_back(first + r, first + c, local[c][r]);
        if (r >= c) fixed.emplace_back(first + r, first + c, scale * (double(r == c) - local[c][r]));
      }
  }
  Sparse rest(hessian.rows(), hessian.rows());
  projector = rest;
  projector.setFromTriplets(free.begin(), free.end());
  rest.setFromTriplets(fixed.begin(), fixed.end());
  const Sparse whole = hessian.selfadjointView<Eigen::Lower>(), moving = projector * whole * projector;
  return Sparse(moving.triangularView<Eigen::Lower>()) + rest;
}

// The step to the minimum of the energy's second-order model among half spaces.
struct NewtonStep {
  Points step, forces;  // m; N, of planes on vertices
  double descent = 0;   // the energy's slope along the step, < 0
  bool exact = true;    // by the Hessian itself, which is positive definite
};

// Where the Hessian is not positive definite, those of constraints are projected, and then a growing multiple of the
// mass matrix is added. False where nothing helps.
bool find_newton_step(Factor& factor, ActiveSet& set, Points g, NewtonStep& result) {
  const Objective& o = set.o;
  const std::size_t n = set.x.size();
  for (std::size_t i = 0; i < n; ++i)
    if (!(o.masses[i] > 0)) g[i] = glm::dvec3(0);
  Sparse hessian = assemble(o, set.x, false), projector;
  Eigen::VectorXd masses(hessian.rows());
  for (Eigen::Index row = 0; row < masses.size(); ++row) masses(row) = o.masses[std::size_t(row / 3)];
  double shift = 0;
  const auto next_hessian = [&] {
    if (result.exact)
      hessian = assemble(o, set.x, true), shift = 1e-8 * hessian.diagonal().sum() / masses.sum();
    else
      hessian.diagonal() += shift * masses, shift *= 100;
    result.exact = false;
  };
  constexpr int most_rounds = 50;
  for (int round = 0, attempt = 0; round < most_rounds; ++round) {
    const bool is_held = set.any();
    while (!factorize(factor, is_held ? constrain(hessian, set, projector) : hessian)) {
      if (++attempt > 12) return false;
      next_hessian();
    }
    result.step.assign(n, glm::dvec3(0)), result.forces = g;
    if (is_held) {
      for (std::size_t i = 0; i < n; ++i) result.step[i] = set.freedom(i).second;
      const Eigen::VectorXd rhs = flat(g) + hessian.selfadjointView<Eigen::Lower>() * flat(result.step);
      const Eigen::VectorXd solved = factor.solve(projector * rhs);
      flat(result.step) -= projector * solved;
      flat(result.forces) += hessian.selfadjointView<Eigen::Lower>() * flat(result.step);
    } else {
      flat(result.step) = factor.solve(-flat(g));
    }
    if (o.plane_count == 0 || !set.update(result.step, result.forces)) break;
  }
  result.descent = flat(g).dot(flat(result.step));
  return true;
}

// Stiff bodies that turn far take hundreds of short steps, all others under 30.
constexpr int newton_limit = 1000;

Minimum newton(const Objective& o, Points start, int most) {
  Minimum result;
  Points& x = result.positions = std::move(start);
  ActiveSet set{o, x, std::vector<char>(x.size() * o.plane_count, 0)};
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!(o.masses[i] > 0)) x[i] = o.predicted[i];
    set.slack = std::max(set.slack, 1e-14 * glm::length(x[i]));
  }
  for (std::size_t i = 0; i < x.size(); ++i)
    for (std::size_t p = 0; p < o.plane_count && o.masses[i] > 0; ++p) {
      const double gap = set.gap(i, p, glm::dvec3(0));
      if (gap < 0) x[i] -= gap * glm::dvec3(o.plane(i, p));
      set.held[i * o.plane_count + p] = gap <= set.slack;
    }
  Factor factor;
  NewtonStep newton;
  while (!result.converged) {
    newton.exact = true;
    if (!find_newton_step(factor, set, gradient(o, x), newton))
      return result.reason = "the Hessian has no factors", result;
    result.residual = std::sqrt(std::max(-newton.descent, 0.0) / o.unit);
    result.converged = newton.exact && result.residual <= minimum_tolerance;
    // The step is taken even after convergence, since it squares the residual.
    if (!newton.exact && result.residual <= 1e-4 * minimum_tolerance)
      return result.reason = "not a stable, isolated minimum", result;
    if (result.iterations == newton_limit) return result.reason = "too many Newton steps", result;
    // Armijo's condition, with an allowance for rounding, by less than which the last steps lower E.
    const Energy before = evaluate_energy(o, x);
    const double rounding = 1e-14 * before.magnitude;
    Points trial = x;
    double t = 1;
    for (int halvings = 0;; ++halvings, t *= 0.5) {
      if (halvings == 60) return result.reason = "no step lowers the energy", result;
      flat(trial) = flat(x) + t * flat(newton.step);
      if (evaluate_energy(o, trial).value <= before.value + 1e-4 * t * newton.descent + rounding) break;
    }
    std::ranges::copy(trial, x.begin());
    if (++result.iterations == most) result.converged = true;
  }
  for (std::size_t i = 0; i < x.size(); ++i)
    for (std::size_t p = 0; p < o.plane_count; ++p)
      if (set.held[i * o.plane_count + p])
        result.touching.push_back(
            {std::uint32_t(i), std::uint32_t(p), glm::dot(glm::dvec3(o.plane(i, p)), newton.forces[i])});
  return result;
}

}  // namespace

// Positions are relative to the first vertex, since those far from the origin have no digits left for small strains.
Minimum minimise(Objective o, Points start, int most) {
  const glm::dvec3 origin = o.predicted.empty() ? glm::dvec3(0) : o.predicted[0];
  for (Points* list : {&o.predicted, &start})
    for (glm::dvec3& p : *list) p -= origin;
  for (glm::dvec4& plane : o.planes) plane.w -= glm::dot(glm::dvec3(plane), origin);
  for (Objective::Drag& drag : o.drags) drag.from -= origin;
  Minimum result = newton(o, std::move(start), most);
  for (glm::dvec3& p : result.positions) p += origin;
  return result;
}

}  // namespace tetpbd
