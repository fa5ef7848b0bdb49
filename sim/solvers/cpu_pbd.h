// PBD on the CPU, the same step as the GPU's, with the same formulas, in a precision of choice. State is in
// double, so no small displacement is lost; constraints are evaluated in `real` from differences of
// positions.
#pragma once

#include <array>
#include <cmath>

#include "sim/constraints.h"
#include "sim/model.h"
#include "sim/settings.h"
#include "sim/solvers/clusters.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// The half spaces of a step, n.x >= d as (n, d).
inline std::vector<glm::dvec4> planes_of(const Model& model, const Settings& settings) {
  std::vector<glm::dvec4> planes = model.obstacles;
  if (settings.ground) planes.insert(planes.begin(), glm::dvec4(0, 1, 0, settings.ground_height));
  return planes;
}

/// A vertex out of all half spaces (eqs. 11-12); `fall`: what prediction moved it by.
inline glm::dvec3 out_of(const std::vector<glm::dvec4>& planes, glm::dvec3 x, const glm::dvec3& predicted,
                         const glm::dvec3& fall, double friction) {
  for (const glm::dvec4& plane : planes) {
    const glm::dvec3 n(plane);
    const double depth = glm::dot(n, x) - plane.w;
    if (depth < 0) x += Formulas<double>{}.plane_correction(n, depth, fall + (x - predicted), friction);
  }
  return x;
}

/// Constraints of one kind, contiguous, in the order they are projected.
template <class Kind, class real>
struct Batch {
  struct Item {
    std::array<std::uint32_t, std::size_t(Kind::row.arity)> vertices;
    real rest;
  };
  std::vector<Item> items;
  std::vector<real> multipliers;  // of compliant constraints, in this substep
};

/// The longest correction of one constraint, m. Shorter with mass splitting, so that the fixed-point sums are
/// finer: their rounding is what moves the centre of a free body then.
inline double longest_correction(const Model& model, const Settings& settings) {
  return settings.mass_splitting ? model.size / 64 : model.size;
}

/// `jacobi`: all corrections from the same positions, averaged with omega / n_i, and shape-matching clusters;
/// with compliance masses are split, and there are no clusters. `gauss_seidel`: one after the other.
enum class Sweep { jacobi, gauss_seidel };

template <class real>
class CpuPbd {
 public:
  CpuPbd(const Model& model, const ConstraintSystem& system) : model_(model), at_vertex_(system.at_vertex) {
    for_each_kind([&](auto kind, int k) {
      using Kind = decltype(kind);
      auto& items = std::get<Batch<Kind, real>>(batches_).items;
      const ConstraintList& list = system.lists[std::size_t(k)];
      items.resize(list.count());
      for (std::size_t c = 0; c < items.size(); ++c) {
        std::copy_n(list.vertices.begin() + std::ptrdiff_t(c * Kind::row.arity), Kind::row.arity,
                    items[c].vertices.begin());
        items[c].rest = real(list.rest[c]);
      }
    });
  }

  /// How often each guard triggered so far.
  GuardCounts guards{};

  /// One step of `settings.dt` (method.md eqs. 1-5, 11-13, 15, 25-26), `settings.substeps` substeps.
  void step(State& state, const Settings& settings, const std::vector<double>& inverse_masses, Sweep sweep) {
    const double h = settings.dt / settings.substeps;
    const glm::dvec3 gravity(0, -settings.gravity, 0);
    const std::vector<glm::dvec4> planes = planes_of(model_, settings);
    const double keep = std::exp(-settings.damping * h);
    auto& x = state.positions;
    auto& v = state.velocities;
    const bool soft = compliant(settings);
    const bool held = sweep == Sweep::jacobi && settings.clusters > 0 && !soft;
    const double omega = soft ? 1 : relaxation(settings.omega, held ? settings.clusters : 0);
    if (held && clusters_.rest.empty()) clusters_ = build_clusters(model_);
    inverse_masses_.assign(inverse_masses.begin(), inverse_masses.end());
    for (int s = 0; s < settings.substeps; ++s) {
      if (damped(settings)) start_ = x;
      if (soft)
        for_each_kind([&](auto kind, int) {
          auto& batch = std::get<Batch<decltype(kind), real>>(batches_);
          batch.multipliers.assign(batch.items.size(), 0);
        });
      for (std::size_t i = 0; i < x.size(); ++i)
        if (inverse_masses[i] > 0) {
          v[i] = (v[i] + h * gravity) * keep;
          x[i] += h * v[i];
        }
      predicted_ = x;
      for (int iteration = 0; iteration < settings.iterations; ++iteration) {
        std::vector<glm::dvec3> pulls;
        if (held) pulls = cluster_pulls(clusters_, x);
        if (sweep == Sweep::jacobi) deltas_.assign(x.size(), glm::dvec3(0));
        for_each_kind(
            [&](auto kind, int k) { project<decltype(kind)>(std::size_t(k), soft, x, settings, sweep); });
        for (std::size_t i = 0; i < x.size(); ++i) {
          if (!(inverse_masses[i] > 0)) continue;
          if (sweep == Sweep::jacobi && at_vertex_[i] > 0) x[i] += deltas_[i] * (omega / at_vertex_[i]);
          if (held) x[i] += settings.clusters * pulls[i];
          x[i] = out_of(planes, x[i], predicted_[i], h * v[i], settings.friction);
        }
      }
      for (std::size_t i = 0; i < x.size(); ++i)
        if (inverse_masses[i] > 0) v[i] += (x[i] - predicted_[i]) / h;
    }
  }

 private:
  template <class Kind>
  void project(std::size_t kind, bool soft, std::vector<glm::dvec3>& x, const Settings& settings,
               Sweep sweep) {
    constexpr std::size_t arity = std::size_t(Kind::row.arity);
    using vec = glm::vec<3, real>;
    const real k = real(settings.stiffness[kind]);
    const real limit = real(sweep == Sweep::jacobi ? longest_correction(model_, settings) : model_.size);
    const bool split = (soft || settings.mass_splitting) && sweep == Sweep::jacobi;
    const double h = settings.dt / settings.substeps;
    const real a = soft ? real(settings.compliance[kind] / (h * h)) : 0,
               gamma = soft ? real(settings.constraint_damping / h) : 0,
               share = soft ? (1 + gamma) / real(sweep == Sweep::jacobi ? settings.omega : 1) : 1;
    Formulas<real> formulas;
    auto& batch = std::get<Batch<Kind, real>>(batches_);
    for (std::size_t number = 0; number < batch.items.size(); ++number) {
      const auto& item = batch.items[number];
      vec local[arity];
      real w[arity];
      for (std::size_t j = 0; j < arity; ++j) {
        local[j] = vec(x[item.vertices[j]] - x[item.vertices[0]]);
        w[j] = inverse_masses_[item.vertices[j]];
        if (split) w[j] *= real(at_vertex_[item.vertices[j]]);
      }
      auto c = Kind::template evaluate<real>(local, item.rest, item.vertices.data());
      if (gamma > 0) {
        vec start[arity];
        for (std::size_t j = 0; j < arity; ++j)
          start[j] = vec(start_[item.vertices[j]] - start_[item.vertices[0]]);
        c.C += gamma * (c.C - Kind::template evaluate<real>(start, item.rest, item.vertices.data()).C);
      }
      if (soft) c.C += a * batch.multipliers[number];
      const real lambda = formulas.multiplier(c, w, k, limit, a, share);
      const std::uint32_t triggered = formulas.guards_of(c, w, k, limit, a, share);
      if (soft) batch.multipliers[number] += lambda;
      for (std::size_t j = 0; lambda != real(0) && j < arity; ++j)
        (sweep == Sweep::jacobi ? deltas_ : x)[item.vertices[j]] += glm::dvec3(lambda * w[j] * c.gradient[j]);
      if (triggered)
        for (std::size_t g = 0; g < GUARDS; ++g) guards[g] += triggered >> g & 1;
    }
  }

  template <class>
  struct Batches;
  template <class... Kind>
  struct Batches<std::tuple<Kind...>> {
    using type = std::tuple<Batch<Kind, real>...>;
  };

  const Model& model_;
  std::vector<std::uint32_t> at_vertex_;
  typename Batches<Kinds>::type batches_;
  std::vector<glm::dvec3> start_, predicted_, deltas_;
  std::vector<real> inverse_masses_;
  Clusters clusters_;  // made when they are first asked for
};

}  // namespace tetpbd
