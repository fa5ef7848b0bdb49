// PBD on the CPU: the GPU's step with the same formulas. State is in double, so that no small displacement is lost, and
// constraints are evaluated in `real` from differences of positions.
#pragma once

#include <array>
#include <cmath>

#include "sim/contact/faces.h"
#include "sim/contact/offset_contact.h"
#include "sim/contact/rigid_contact.h"
#include "sim/model/attachments.h"
#include "sim/model/constraints.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"
#include "sim/solvers/solver.h"
#include "sim/yielding.h"

namespace tetpbd {

/// What the constraints of a kind share (shaders/constraints/types.glsl, multiplier).
template <class real>
struct Rule {
  real k, limit, a, gamma, share;
  double softness;  ///< factor of a material's compliance, 1/s^2, of rates 1/s
  double h, omega;
  Rule(const Settings& settings, double substep, std::size_t kind, double longest, double relaxation = 1)
      : limit(real(longest)), h(substep), omega(relaxation) {
    softness = constraint_kinds[kind].rate ? 1 / h : 1 / (h * h);
    a = real(settings.compliance[kind] / (h * h));
    set(settings.stiffness[kind], settings.constraint_damping, constraint_kinds[kind]);
  }
  /// Takes over k, and damping in s, of a body with a material of its own.
  void set(double stiffness, double damping, const ConstraintKind& kind) {
    k = real(stiffness), gamma = real(damping / h);
    const bool undamped = kind.rate || kind.components > 1;  // Such kinds are damped by dashpots instead.
    share = (undamped ? 1 : 1 + gamma) / real(omega);
  }
};

/// How much C changed from `then`, at positions `start`, to c, at positions x, without cancellation.
template <class Constraint, class Vector>
[[gnu::always_inline]] inline auto constraint_change(const Constraint& c, const Constraint& then, const Vector* x,
                                                     const Vector* start) {
  decltype(c.C) sum = 0;
  for (std::size_t j = 0; j < std::size(c.gradient); ++j)
    sum += decltype(c.C)(0.5) * glm::dot(c.gradient[j] + then.gradient[j], x[j] - start[j]);
  return sum;
}

/// Projects one constraint (eqs. 6, 17-18, 23). `compliance` is a material's, or null. `vertices` tells where a vertex
/// is (at), where it was at the substep's start (start) and its inverse mass (weight), and applies a correction (move).
template <class Kind, class real, class Vertices>
[[gnu::always_inline]] inline void project(const std::uint32_t* ids, const real* rest, const double* compliance,
                                           const Rule<real>& rule, real* multipliers, Vertices&& vertices,
                                           GuardCounts& guards) {
  constexpr int components = Kind::row.components;
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  glm::vec<3, real> local[arity];
  const auto evaluate = [&](auto&& position) {
    for (std::size_t j = 0; j < arity; ++j) local[j] = glm::vec<3, real>(position(ids[j]) - position(ids[0]));
    return Kind::template evaluate<real>(local, rest_values<Kind>(rest), ids);
  };
  auto c = evaluate([&](std::uint32_t v) { return vertices.at(v); });
  real w[arity], a[components];
  for (std::size_t j = 0; j < arity; ++j) w[j] = vertices.weight(ids[j]);
  for (int k = 0; k < components; ++k) a[k] = compliance ? real(compliance[k] * rule.softness) : rule.a;
  std::uint32_t triggered = 0;
  if constexpr (components == 1) {
    if (Kind::row.rate || rule.gamma > 0) {
      const auto here = std::to_array(local);
      const auto then = evaluate([&](std::uint32_t v) { return vertices.start(v); });
      c.C = Kind::row.rate ? constraint_change(c, then, here.data(), local) : c.C + rule.gamma * (c.C - then.C);
    }
    c.C += a[0] * multipliers[0];
    const auto m = Formulas<real>{}.multiplier(c, w, rule.k, rule.limit, a[0], rule.share);
    multipliers[0] += m.lambda;
    triggered = m.guards;
    for (std::size_t j = 0; m.lambda != 0 && j < arity; ++j)
      vertices.move(ids[j], glm::dvec3(m.lambda * w[j] * c.gradient[j]));
  } else {
    for (int k = 0; k < components; ++k) c.C[k] += a[k] * multipliers[k];
    const auto m = Formulas<real>{}.multiplier(c, w, rule.limit, a, rule.share);
    for (int k = 0; k < components; ++k) multipliers[k] += m.lambda[k];
    triggered = m.guards;
    for (std::size_t j = 0; j < arity; ++j)
      vertices.move(ids[j], glm::dvec3(w[j] * (m.lambda[0] * c.gradient[0][j] + m.lambda[1] * c.gradient[1][j])));
  }
  if (triggered)
    for (std::size_t g = 0; g < GUARDS; ++g) guards[g] += triggered >> g & 1;
}

/// The longest correction of one constraint, m. It is shorter with mass splitting, so that the fixed-point sums are
/// finer: only their rounding moves the centre of a free body then.
inline double longest_correction(const Model& model, const Settings& settings) {
  return splits_masses(settings) ? model.size / 64 : model.size;
}

/// Jacobi makes all corrections from the same positions and averages them with omega / n_i, or splits masses;
/// Gauss-Seidel projects one constraint after the other.
enum class Sweep { jacobi, gauss_seidel };

template <class real>
class CpuPbd {
 public:
  CpuPbd(const Model& model, const ConstraintSystem& system)
      : model_(&model),
        pairs_(model),
        faces_(wide_faces(model)),
        rigid_(model, system),
        at_vertex_(system.at_vertex),
        load_mesh_(lay_out_loads(model)),
        fibres_(system.lists[std::size_t(index_of<Fibre>)]) {
    for_each_kind([&](auto kind, int k) {
      constexpr std::size_t arity = std::size_t(decltype(kind)::row.arity);
      const ConstraintList& list = system.lists[std::size_t(k)];
      auto& items = std::get<Items<decltype(kind)>>(items_);
      items.resize(list.count());
      for (std::size_t c = 0; c < items.size(); ++c) {
        std::copy_n(list.vertices.data() + c * arity, arity, items[c].vertices.data());
        for (std::size_t v = 0; v < items[c].rest.size(); ++v)
          items[c].rest[v] = real(list.rest[c * items[c].rest.size() + v]);
      }
      own_[std::size_t(k)] = {list.compliance, list.stiffness, list.damping};
    });
  }

  /// Goes on with a model that differs in its obstacles alone.
  void change_model(const Model& model) { model_ = &model, pairs_.change_model(model), faces_ = wide_faces(model); }

  /// One step of `settings.dt` (method.md eqs. 1-4, 6, 13, 16-18, 48-49).
  GuardCounts step(State& state, const Settings& settings, const std::vector<double>& inverse_masses, Sweep sweep,
                   double time = 0) {
    const bool jacobi = sweep == Sweep::jacobi, soft = any_material(settings, compliant);
    const double omega = soft ? 1 : settings.omega;
    const double longest = jacobi ? longest_correction(*model_, settings) : model_->size;
    const Plan plan = plan_for(settings);
    Substep substep(*model_, settings, plan, time);
    rigid_.begin(*model_, settings);
    auto& x = state.positions;
    auto& v = state.velocities;
    if (substep.books_work()) state.work.resize(x.size());
    adopt_rest_metrics(state);
    if (!model_->fibres.empty()) activate(state, activations_of_step(*model_, settings, time));
    std::vector<glm::dvec3> start, predicted, sums;
    std::vector<real> weights(inverse_masses.begin(), inverse_masses.end());
    if (jacobi && splits_masses(settings))
      for (std::size_t i = 0; i < x.size(); ++i) weights[i] *= real(at_vertex_[i]);
    GuardCounts guards{};
    const Vertices vertices{x, start, weights, jacobi ? sums : x};
    pairs_.begin_step(state);
    for (int s = 0; s < plan.substeps; ++s) {
      if (any_material(settings, damped)) start = x;
      substep.begin(s);
      substep.find_loads(
          load_mesh_, [&](std::uint32_t i) { return x[i]; }, v);
      pairs_.begin(settings, x, v);
      rigid_.prepare(substep, inverse_masses, vertices, v, state.work, guards, pairs_.wrenches());
      for (std::size_t i = 0; i < x.size(); ++i)
        x[i] = inverse_masses[i] > 0 ? rigid_.predict(substep, i, x[i], v[i]) : x[i] + substep.h * v[i];
      predicted = x;
      for (int iteration = 0; iteration < plan.iterations; ++iteration) {
        if (jacobi) sums.assign(x.size(), glm::dvec3(0));
        for_each_kind([&](auto kind, int k) {
          Rule<real> rule(settings, plan.h, std::size_t(k), longest, jacobi && soft ? settings.omega : 1);
          const Own& own = own_[std::size_t(k)];
          const double* compliance = own.compliance.empty() ? nullptr : own.compliance.data();
          std::size_t number = 0;
          for (auto& item : std::get<Items<decltype(kind)>>(items_)) {
            if (iteration == 0) item.multipliers = {};
            if (!own.stiffness.empty()) rule.set(own.stiffness[number], own.damping[number], kind.row), ++number;
            project<decltype(kind)>(item.vertices.data(), item.rest.data(), compliance, rule, item.multipliers.data(),
                                    vertices, guards);
            if (compliance) compliance += decltype(kind)::row.components;
          }
        });
        for (std::size_t i = 0; i < x.size(); ++i) {
          if (!(inverse_masses[i] > 0)) continue;
          if (jacobi && at_vertex_[i] > 0) x[i] += sums[i] * (omega / at_vertex_[i]);
          double* work = substep.moving && !rigid_.carries(i) ? &state.work[i] : nullptr;
          x[i] = substep.out_of_obstacles(i, x[i], predicted[i], v[i], work);
        }
      }
      for (std::size_t i = 0; i < x.size(); ++i)
        if (inverse_masses[i] > 0) {
          v[i] = rigid_.velocity_after(substep, i, x[i], predicted[i], v[i]);
          substep.book_loads(i, v[i], state.work);
        }
      if (are_faces_due(plan, s))
        move_faces_out(*model_, settings, faces_, substep.obstacles, substep.h, x, v, inverse_masses, state.work);
      pairs_.resolve(settings, x, v, inverse_masses, substep.h, substep.h / OffsetContact::recovery, rigid_.carried());
    }
    pairs_.end_step(state);
    return guards;
  }

 private:
  void adopt_rest_metrics(const State& state) {
    if (state.rest_metrics.empty()) return;
    auto& items = std::get<Items<NeoHookean>>(items_);
    if (tets_.empty()) tets_ = find_tets(model_->rest, items.size(), [&](std::size_t c) { return items[c].vertices; });
    for (std::size_t c = 0; c < items.size(); ++c)
      std::copy_n(&state.rest_metrics[6 * tets_[c]], 6, items[c].rest.begin());
  }
  void activate(State& state, const Activations& step) {
    state.work[0] += activation_work(fibres_, step, state.positions);
    for (auto& item : std::get<Items<Fibre>>(items_)) item.rest[3] = 1 - real(step.now[std::size_t(item.rest[4])]);
  }
  template <class Kind>
  struct Item {
    std::array<std::uint32_t, std::size_t(Kind::row.arity)> vertices;
    std::array<real, std::size_t(Kind::row.values)> rest;
    std::array<real, std::size_t(Kind::row.components)> multipliers;  // in this substep
  };
  template <class Kind>
  using Items = std::vector<Item<Kind>>;  // contiguous, in the order they are projected
  struct Vertices {
    const std::vector<glm::dvec3>&x, &starts;
    const std::vector<real>& weights;
    std::vector<glm::dvec3>& moved;
    const glm::dvec3& at(std::uint32_t v) const { return x[v]; }
    const glm::dvec3& start(std::uint32_t v) const { return starts[v]; }
    real weight(std::uint32_t v) const { return weights[v]; }
    void move(std::uint32_t v, const glm::dvec3& by) const { moved[v] += by; }
  };

  const Model* model_;
  OffsetContact pairs_;
  std::vector<Triangle> faces_;
  RigidContact rigid_;
  std::vector<std::uint32_t> at_vertex_;
  std::vector<glm::uvec4> load_mesh_;
  ConstraintList fibres_;
  OfEachKind<Items> items_;
  std::vector<std::uint32_t> tets_;  // of neo-Hookean items, once any has flowed
  // What materials give constraints, else empty.
  struct Own {
    std::vector<double> compliance, stiffness, damping;
  };
  std::array<Own, kind_count> own_;
};

}  // namespace tetpbd
