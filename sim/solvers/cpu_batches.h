// Batches of mode cpu-fast: constraints of one kind that share no vertex, evaluated in the lanes of vector
// instructions.
#pragma once

#include <algorithm>
#include <cstring>

#include "sim/solvers/cpu_pbd.h"
#include "sim/solvers/lane_math.h"

namespace tetpbd::batches {

constexpr std::size_t lanes = 16;

using Row = double __attribute__((vector_size(32)));      // x, y, z in m, and a vertex's inverse mass in 1/kg
using FloatRow = float __attribute__((vector_size(16)));  // a difference or correction of the first three

// GCC 12 gives a bare Row the alignment of a double where it is an element of std::vector.
struct alignas(sizeof(Row)) Vertex {
  Row row;
  glm::dvec3 position() const { return {row[0], row[1], row[2]}; }
  void move_to(const glm::dvec3& p) { row = Row{p.x, p.y, p.z, row[3]}; }
};

template <class Kind>
struct Batch {
  std::uint32_t vertices[std::size_t(Kind::row.arity)][lanes];
  float rest[std::size_t(Kind::row.values)][lanes];
  float multipliers[std::size_t(Kind::row.components)][lanes];  // in this substep
  std::uint32_t count;                                          // lanes in use; the others repeat the first
  double stiffness = -1, damping = 0;                           // k, and s, of a body's own material; else -1
  Rule<float> rule(Rule<float> all) const {
    if (stiffness >= 0) all.set(stiffness, damping, Kind::row);
    return all;
  }
};
template <class Kind>
using Batches = std::vector<Batch<Kind>>;
// The compliances that a material gives a batch.
template <class Kind>
struct Softness {
  double values[std::size_t(Kind::row.components)][lanes];
};
template <class Kind>
using Softnesses = std::vector<Softness<Kind>>;

struct Work {
  OfEachKind<Batches> batches;
  OfEachKind<Softnesses> softnesses;  // of each batch, or none
  std::vector<Vertex> x;
  std::vector<Vertex> starts;  // of the substep, with constraint damping

  // What project() and RigidContact ask for.
  glm::dvec3 at(std::uint32_t v) const { return x[v].position(); }
  glm::dvec3 start(std::uint32_t v) const { return starts[v].position(); }
  float weight(std::uint32_t v) const { return float(x[v].row[3]); }
  void move(std::uint32_t v, const glm::dvec3& by) { x[v].row += Row{by.x, by.y, by.z, 0}; }
};

// Projects a batch in which a guard triggers, one constraint after the other.
template <class Kind>
[[gnu::noinline]] void project_guarded(Batch<Kind>& batch, const Softness<Kind>* softness, Work& work,
                                       const Rule<float>& rule, GuardCounts& guards) {
  constexpr std::size_t components = std::size_t(Kind::row.components);
  for (std::size_t lane = 0; lane < batch.count; ++lane) {
    std::uint32_t ids[std::size_t(Kind::row.arity)];
    float rest[std::size_t(Kind::row.values)], multipliers[std::size_t(Kind::row.components)];
    double compliance[components];
    for (std::size_t j = 0; j < std::size(ids); ++j) ids[j] = batch.vertices[j][lane];
    for (std::size_t v = 0; v < std::size(rest); ++v) rest[v] = batch.rest[v][lane];
    for (std::size_t k = 0; k < std::size(multipliers); ++k) multipliers[k] = batch.multipliers[k][lane];
    for (std::size_t k = 0; k < components; ++k) compliance[k] = softness ? softness->values[k][lane] : 0;
    project<Kind>(ids, rest, softness ? compliance : nullptr, rule, multipliers, work, guards);
    for (std::size_t k = 0; k < std::size(multipliers); ++k) batch.multipliers[k][lane] = multipliers[k];
  }
}

inline void store(float* to, FloatRow row) { std::memcpy(to, &row, sizeof row); }
inline FloatRow load(const float* from) {
  FloatRow row;
  std::memcpy(&row, from, sizeof row);
  return row;
}

[[gnu::always_inline]] inline void transpose(FloatRow (&r)[4]) {
  using Pick = std::int32_t __attribute__((vector_size(16)));
  const FloatRow xy01 = __builtin_shuffle(r[0], r[1], Pick{0, 4, 1, 5}),
                 xy23 = __builtin_shuffle(r[2], r[3], Pick{0, 4, 1, 5}),
                 zw01 = __builtin_shuffle(r[0], r[1], Pick{2, 6, 3, 7}),
                 zw23 = __builtin_shuffle(r[2], r[3], Pick{2, 6, 3, 7});
  r[0] = __builtin_shuffle(xy01, xy23, Pick{0, 1, 4, 5});
  r[1] = __builtin_shuffle(xy01, xy23, Pick{2, 3, 6, 7});
  r[2] = __builtin_shuffle(zw01, zw23, Pick{0, 1, 4, 5});
  r[3] = __builtin_shuffle(zw01, zw23, Pick{2, 3, 6, 7});
}

// Values by vertex, coordinate and lane: positions relative to the first vertex, and in their place corrections. The
// fourth coordinate is the inverse mass.
template <class Kind>
using Columns = float[std::size_t(Kind::row.arity)][4][lanes];

template <class Kind>
[[gnu::always_inline]] inline void gather(const Batch<Kind>& batch, const std::vector<Vertex>& x,
                                          Columns<Kind>& columns) {
  for (std::size_t lane = 0; lane < lanes; lane += 4) {
    Row origins[4];
#pragma GCC unroll 4
    for (std::size_t i = 0; i < 4; ++i) {
      origins[i] = x[batch.vertices[0][lane + i]].row;
      columns[0][3][lane + i] = float(origins[i][3]);
      origins[i][3] = 0;
    }
#pragma GCC unroll 4
    for (std::size_t j = 1; j < std::size_t(Kind::row.arity); ++j) {
      FloatRow rows[4];
#pragma GCC unroll 4
      for (std::size_t i = 0; i < 4; ++i)
        rows[i] = __builtin_convertvector(x[batch.vertices[j][lane + i]].row - origins[i], FloatRow);
      transpose(rows);
#pragma GCC unroll 4
      for (std::size_t axis = 0; axis < 4; ++axis) store(&columns[j][axis][lane], rows[axis]);
    }
  }
}

template <class Kind>
[[gnu::always_inline]] inline void scatter(const Batch<Kind>& batch, Work& work, const Columns<Kind>& columns) {
  const auto add = [&](std::size_t lane, std::size_t count) __attribute__((always_inline)) {
#pragma GCC unroll 4
    for (std::size_t j = 0; j < std::size_t(Kind::row.arity); ++j) {
      FloatRow rows[4] = {};
#pragma GCC unroll 3
      for (std::size_t axis = 0; axis < 3; ++axis) rows[axis] = load(&columns[j][axis][lane]);
      transpose(rows);
      for (std::size_t i = 0; i < count; ++i)
        work.x[batch.vertices[j][lane + i]].row += __builtin_convertvector(rows[i], Row);
    }
  };
  std::size_t lane = 0;
  for (; lane + 4 <= batch.count; lane += 4) add(lane, 4);
  if (lane < batch.count) add(lane, batch.count - lane);
}

// Puts corrections in place of positions. Returns false if a guard triggered, with multipliers as they were.
template <class Kind, bool damped>
[[gnu::always_inline]] inline bool evaluate(Batch<Kind>& batch, const Softness<Kind>* softness, const Rule<float>& rule,
                                            Columns<Kind>& columns, [[maybe_unused]] const Columns<Kind>& starts) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity), components = std::size_t(Kind::row.components),
                        values = std::size_t(Kind::row.values);
  static constexpr std::uint32_t no_ids[4] = {};  // Guards alone need them, and their results are not used here.
  std::uint32_t guards[lanes];
  float multipliers[components][lanes], softness_now[components][lanes];
  const float k = rule.k, limit = rule.limit, all = rule.a, gamma = rule.gamma, share = rule.share;
  const double unit = rule.softness;
  for (std::size_t part = 0; part < components; ++part)
    for (std::size_t lane = 0; lane < lanes; ++lane)
      softness_now[part][lane] = softness ? float(softness->values[part][lane] * unit) : all;
#pragma GCC ivdep
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    glm::vec3 x[arity];
    float w[arity];
#pragma GCC unroll 4
    for (std::size_t j = 0; j < arity; ++j) {
      x[j] = j == 0 ? glm::vec3(0) : glm::vec3(columns[j][0][lane], columns[j][1][lane], columns[j][2][lane]);
      w[j] = columns[j][3][lane];
    }
    float rest[values], a[components];
    for (std::size_t v = 0; v < values; ++v) rest[v] = batch.rest[v][lane];
    for (std::size_t part = 0; part < components; ++part) a[part] = softness_now[part][lane];
    auto c = Kind::template evaluate<float, LaneMath>(x, rest_values<Kind>(rest), no_ids);
    [[maybe_unused]] glm::vec3 start[arity];
    if constexpr (damped) {
#pragma GCC unroll 4
      for (std::size_t j = 0; j < arity; ++j)
        start[j] = j == 0 ? glm::vec3(0) : glm::vec3(starts[j][0][lane], starts[j][1][lane], starts[j][2][lane]);
      if constexpr (components == 1) {
        const auto then = Kind::template evaluate<float, LaneMath>(start, rest_values<Kind>(rest), no_ids);
        c.C = Kind::row.rate ? constraint_change(c, then, x, start) : c.C + gamma * (c.C - then.C);
      }
    }
    glm::vec3 corrections[arity];
    if constexpr (components == 1) {
      c.C += a[0] * batch.multipliers[0][lane];
      const auto m = Formulas<float, LaneMath>{}.multiplier(c, w, k, limit, a[0], share);
#pragma GCC unroll 4
      for (std::size_t j = 0; j < arity; ++j) corrections[j] = m.lambda * w[j] * c.gradient[j];
      multipliers[0][lane] = batch.multipliers[0][lane] + m.lambda;
      guards[lane] = m.guards;
    } else {
      for (std::size_t part = 0; part < components; ++part) c.C[part] += a[part] * batch.multipliers[part][lane];
      const auto m = Formulas<float, LaneMath>{}.multiplier(c, w, limit, a, share);
#pragma GCC unroll 4
      for (std::size_t j = 0; j < arity; ++j)
        corrections[j] = w[j] * (m.lambda[0] * c.gradient[0][j] + m.lambda[1] * c.gradient[1][j]);
      for (std::size_t part = 0; part < components; ++part)
        multipliers[part][lane] = batch.multipliers[part][lane] + m.lambda[part];
      guards[lane] = m.guards;
    }
#pragma GCC unroll 4
    for (std::size_t j = 0; j < arity; ++j)
      for (int axis = 0; axis < 3; ++axis) columns[j][axis][lane] = corrections[j][axis];
  }
  std::uint32_t triggered = 0;
  for (std::uint32_t lane : guards) triggered |= lane;
  if (triggered == 0) std::copy_n(&multipliers[0][0], components * lanes, &batch.multipliers[0][0]);
  return triggered == 0;
}

/// Projects batches [begin, end); `first`: in a substep's first iteration, which begins with multipliers of 0.
template <class Kind, bool damped>
[[gnu::always_inline]] inline void project_batches(Work& work, std::size_t begin, std::size_t end,
                                                   const Rule<float>& all, bool first, GuardCounts& guards) {
  Batch<Kind>* batches = std::get<Batches<Kind>>(work.batches).data();
  const auto& own = std::get<Softnesses<Kind>>(work.softnesses);
  for (std::size_t b = begin; b < end; ++b) {
    const Softness<Kind>* softness = own.empty() ? nullptr : &own[b];
    const Rule<float> rule = batches[b].rule(all);
    Columns<Kind> columns;
    [[maybe_unused]] Columns<Kind> starts;
    gather(batches[b], work.x, columns);
    if constexpr (damped) gather(batches[b], work.starts, starts);
    if (first) std::fill_n(&batches[b].multipliers[0][0], std::size_t(Kind::row.components) * lanes, 0.0f);
    if (evaluate<Kind, damped>(batches[b], softness, rule, columns, starts))
      scatter(batches[b], work, columns);
    else
      project_guarded(batches[b], softness, work, rule, guards);
  }
}

/// Where the batch ends that begins with constraint `begin` of a colour, which itself goes up to `end`: the constraints
/// of a batch have k and damping in common.
inline std::size_t find_batch_end(const ConstraintList& list, std::size_t begin, std::size_t end) {
  std::size_t next = std::min(begin + lanes, end);
  const auto like_first = [&](std::size_t c) {
    return list.stiffness[c] == list.stiffness[begin] && list.damping[c] == list.damping[begin];
  };
  while (!list.stiffness.empty() && !like_first(next - 1)) --next;
  return next;
}

/// Appends constraints [begin, end) of the list as a batch.
template <class Kind>
void add_batch(Work& work, const ConstraintList& list, std::size_t begin, std::size_t end) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity), values = std::size_t(Kind::row.values),
                        components = std::size_t(Kind::row.components);
  Batch<Kind>& batch = std::get<Batches<Kind>>(work.batches).emplace_back();
  auto& softnesses = std::get<Softnesses<Kind>>(work.softnesses);
  batch.count = std::uint32_t(end - begin);
  if (!list.compliance.empty()) softnesses.emplace_back();
  if (!list.stiffness.empty()) batch.stiffness = list.stiffness[begin], batch.damping = list.damping[begin];
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t c = begin + (lane < batch.count ? lane : 0);
    for (std::size_t j = 0; j < arity; ++j) batch.vertices[j][lane] = list.vertices[c * arity + j];
    for (std::size_t v = 0; v < values; ++v) batch.rest[v][lane] = float(list.rest[c * values + v]);
    for (std::size_t k = 0; k < components && !list.compliance.empty(); ++k)
      softnesses.back().values[k][lane] = list.compliance[c * components + k];
  }
}

}  // namespace tetpbd::batches
