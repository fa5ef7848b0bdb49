// Coloured Gauss-Seidel on all CPU cores (method.md, mode cpu-fast): batches of constraints of
// one colour are evaluated in the lanes of vector instructions, and batches of a colour are shared out among
// threads. Who solves a batch changes nothing in it, so results do not depend on the number of threads.
#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <memory>
#include <thread>

#include "sim/sim.h"
#include "sim/solvers/colours.h"
#include "sim/solvers/cpu_pbd.h"
#include "sim/solvers/lane_math.h"

// The widest vector instructions that the machine has, chosen when the program starts. Other compilers and
// processors get what the build is for.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDEST [[gnu::target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default"), gnu::flatten]]
#else
#define WIDEST
#endif

namespace tetpbd {

namespace {

constexpr std::size_t lanes = 16;

using Row = double __attribute__((vector_size(32)));      // x, y, z in m, and a vertex's inverse mass in 1/kg
using FloatRow = float __attribute__((vector_size(16)));  // a difference or correction of the first three

// As an element of std::vector a bare Row would have the alignment of a double (GCC 12).
struct alignas(sizeof(Row)) Vertex {
  Row row;
  glm::dvec3 position() const { return {row[0], row[1], row[2]}; }
};

// Constraints of one colour.
template <class Kind>
struct Batch {
  std::uint32_t vertices[std::size_t(Kind::row.arity)][lanes];
  float rest[std::size_t(Kind::row.values)][lanes];
  float multipliers[std::size_t(Kind::row.components)][lanes];  // in this substep
  std::uint32_t count;                                          // lanes in use; the others repeat the first
  double stiffness = -1, damping = 0;                           // of a body's own material, s; else -1
  Rule<float> rule(Rule<float> all) const {
    if (stiffness >= 0) all.set(stiffness, damping, Kind::row);
    return all;
  }
};
template <class Kind>
using Batches = std::vector<Batch<Kind>>;
// A material's compliances of such constraints.
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

  // What project() asks for.
  glm::dvec3 at(std::uint32_t v) const { return x[v].position(); }
  glm::dvec3 start(std::uint32_t v) const { return starts[v].position(); }
  float weight(std::uint32_t v) const { return float(x[v].row[3]); }
  void move(std::uint32_t v, const glm::dvec3& by) { x[v].row += Row{by.x, by.y, by.z, 0}; }
};

// A batch where a guard triggers: one constraint after the other.
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

// Four rows become four columns.
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

// By vertex, coordinate and lane: first positions relative to the first vertex, then corrections; fourth,
// inverse masses.
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

// Corrections in place of positions; false, and multipliers as they were, if a guard triggered.
template <class Kind, bool damped>
[[gnu::always_inline]] inline bool evaluate(Batch<Kind>& batch, const Softness<Kind>* softness, const Rule<float>& rule,
                                            Columns<Kind>& columns, [[maybe_unused]] const Columns<Kind>& starts) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity), components = std::size_t(Kind::row.components),
                        values = std::size_t(Kind::row.values);
  static constexpr std::uint32_t no_ids[4] = {};  // for guards' directions only, and those are not used here
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

// Batches [begin, end) of a kind; `first`: in a substep's first iteration.
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

// By the kind's number.
WIDEST void project_kind(Work& work, int kind, std::size_t begin, std::size_t end, const Rule<float>& rule, bool first,
                         GuardCounts& guards) {
  for_each_kind([&](auto is, int number) __attribute__((always_inline)) {
    if (number != kind) return;
    if (!work.starts.empty())
      project_batches<decltype(is), true>(work, begin, end, rule, first, guards);
    else
      project_batches<decltype(is), false>(work, begin, end, rule, first, guards);
  });
}

// Where threads wait for each other, some hundred times a step. Each writes a number of its own and watches
// those of the others for a while before it lets others run.
class Barrier {
 public:
  explicit Barrier(std::size_t most) : threads(most), arrivals_(most) {}
  std::size_t threads;  ///< at most as many as it was made for

  /// No exception may leave a parallel region, so each thread's work ends here: one that fails lets the
  /// others out of their waiting, and rethrow() throws what it threw.
  template <class Work>
  void run(Work&& work) noexcept {
    try {
      work();
    } catch (const Abandoned&) {
    } catch (...) {
#pragma omp critical(barrier_failure)
      if (!failure_) failure_ = std::current_exception();
      failed_.store(true, std::memory_order_release);
    }
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }
  void wait(std::size_t thread) {
    if (threads == 1) return;
    const unsigned now = arrivals_[thread].count.load(std::memory_order_relaxed) + 1;
    arrivals_[thread].count.store(now, std::memory_order_release);
    int looks = 0;
    for (std::size_t other = 0; other < threads; ++other)
      while (int(arrivals_[other].count.load(std::memory_order_acquire) - now) < 0) {
        if (failed_.load(std::memory_order_acquire)) throw Abandoned();
        if (++looks > 4000) std::this_thread::yield();
      }
  }

 private:
  struct Abandoned {};
  struct alignas(64) Arrivals {
    std::atomic<unsigned> count = 0;
  };
  std::vector<Arrivals> arrivals_;  // by thread
  std::atomic<bool> failed_ = false;
  std::exception_ptr failure_;  // the first
};

// A colour of a kind: batches [begin, end).
struct Turn {
  int kind;
  std::size_t begin, end;
};

class FastPbd {
 public:
  FastPbd(const SolverInput& input) : model_(&input.model), pairs_(input.model) {
    std::size_t all = 0;
    for_each_kind([&](auto is, int kind) {
      auto& batches = std::get<Batches<decltype(is)>>(work_.batches);
      const Coloured colours = coloured(input.system.lists[std::size_t(kind)], input.model.positions.size());
      for (std::size_t colour = 0; colour + 1 < colours.first.size(); ++colour) {
        const std::size_t before = batches.size(), end = colours.first[colour + 1];
        for (std::size_t begin = colours.first[colour], next; begin < end; begin = next) {
          next = end_of_batch(colours.list, begin, end);
          fill(batches.emplace_back(), std::get<Softnesses<decltype(is)>>(work_.softnesses), colours.list, begin, next);
        }
        turns_.push_back({kind, before, batches.size()});
      }
      all += batches.size();
    });
    const std::size_t useful = all / (batches_of_a_useful_thread * std::max<std::size_t>(turns_.size(), 1));
    const std::size_t cores = std::size_t(std::max(omp_get_num_procs(), 1));
    threads_ = input.tuning.threads ? input.tuning.threads : std::clamp<std::size_t>(useful, 1, cores);
  }

  void change_model(const Model& model) { model_ = &model, pairs_.change_model(model); }

  /// As CpuPbd::step, in another order.
  GuardCounts step(State& state, const Settings& settings, const std::vector<double>& inverse_masses, double time) {
    const Plan plan = plan_for(settings);
    Substep substep(*model_, settings, plan, time);
    RigidContact contact(*model_, settings);
    auto& v = state.velocities;
    auto& x = work_.x;
    x.resize(state.positions.size());
    const bool damped = any_material(*model_, settings, tetpbd::damped);
    work_.starts.resize(damped ? x.size() : 0);
    predicted_.resize(x.size());
    const auto move_to = [&](std::size_t i, const glm::dvec3& p) { x[i].row = Row{p.x, p.y, p.z, inverse_masses[i]}; };
    for (std::size_t i = 0; i < x.size(); ++i) move_to(i, state.positions[i]);
    GuardCounts guards{};
    Barrier barrier(threads_);
    const auto substeps = [&](std::size_t thread, std::size_t threads) {
      const std::size_t begin = x.size() * thread / threads, end = x.size() * (thread + 1) / threads;
      const auto for_each_free_vertex = [&](auto&& act) {
        for (std::size_t i = begin; i < end; ++i)
          if (inverse_masses[i] > 0) act(i);
      };
      GuardCounts counts{};
      for (int s = 0; s < plan.substeps; ++s) {
        if (damped) std::copy_n(x.data() + begin, end - begin, work_.starts.data() + begin);
        if (contact.wanted() || (substep.moving && s > 0)) {
          barrier.wait(thread);
          if (thread == 0) substep.begin(s), contact.prepare(substep, inverse_masses, work_, v, counts);
          barrier.wait(thread);
        }
        for_each_free_vertex([&](std::size_t i) {
          predicted_[i] = contact.predict(substep, i, x[i].position(), v[i]);
          move_to(i, predicted_[i]);
        });
        for (int iteration = 0; iteration < plan.iterations; ++iteration) {
          solve(settings, plan.h, thread, threads, iteration == 0, barrier, counts);
          for_each_free_vertex(
              [&](std::size_t i) { move_to(i, substep.out_of_obstacles(i, x[i].position(), predicted_[i], v[i])); });
        }
        for_each_free_vertex([&](std::size_t i) {
          if (!contact.carries(i)) v[i] += (x[i].position() - predicted_[i]) / substep.h;
        });
        if (bodies_touch(*model_, settings)) {
          barrier.wait(thread);
          if (thread == 0) {
            for (std::size_t i = 0; i < x.size(); ++i) state.positions[i] = x[i].position();
            pairs_.resolve(settings, state.positions, v, state.held, inverse_masses, substep.h);
            for (std::size_t i = 0; i < x.size(); ++i) move_to(i, state.positions[i]);
          }
          barrier.wait(thread);
        }
      }
#pragma omp critical
      for (std::size_t g = 0; g < counts.size(); ++g) guards[g] += counts[g];
    };
// Loops inside the region itself would be 4 % slower on one thread.
#pragma omp parallel num_threads(int(threads_))
    {
#pragma omp single
      barrier.threads = std::size_t(omp_get_num_threads());
      barrier.run([&] { substeps(std::size_t(omp_get_thread_num()), barrier.threads); });
    }
    barrier.rethrow();
    for (std::size_t i = 0; i < x.size(); ++i) state.positions[i] = x[i].position();
    return guards;
  }

 private:
  // Of a colour, on average: they take about 0.2 us each, and a barrier with fetching what other threads have
  // moved about 2.
  static constexpr std::size_t batches_of_a_useful_thread = 2;

  // Those of a batch have k and damping in common.
  static std::size_t end_of_batch(const ConstraintList& list, std::size_t begin, std::size_t end) {
    std::size_t next = std::min(begin + lanes, end);
    const auto like_first = [&](std::size_t c) {
      return list.stiffness[c] == list.stiffness[begin] && list.damping[c] == list.damping[begin];
    };
    while (!list.stiffness.empty() && !like_first(next - 1)) --next;
    return next;
  }

  template <class Kind>
  static void fill(Batch<Kind>& batch, Softnesses<Kind>& softnesses, const ConstraintList& list, std::size_t begin,
                   std::size_t end) {
    constexpr std::size_t arity = std::size_t(Kind::row.arity), values = std::size_t(Kind::row.values),
                          components = std::size_t(Kind::row.components);
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

  // One iteration's constraints, colour after colour. Small colours are left to the first thread: neighbours
  // among them then need no barrier.
  void solve(const Settings& settings, double h, std::size_t thread, std::size_t threads, bool first, Barrier& barrier,
             GuardCounts& guards) {
    bool shared_before = true;
    for (const Turn& turn : turns_) {
      const std::size_t count = turn.end - turn.begin;
      const bool shared = count >= threads;
      if (shared || shared_before) barrier.wait(thread);
      shared_before = shared;
      if (!shared && thread > 0) continue;
      const std::size_t begin = turn.begin + (shared ? count * thread / threads : 0);
      const std::size_t end = turn.begin + (shared ? count * (thread + 1) / threads : count);
      const Rule<float> rule(settings, h, std::size_t(turn.kind), model_->size);
      project_kind(work_, turn.kind, begin, end, rule, first, guards);
    }
    barrier.wait(thread);
  }

  const Model* model_;
  PairContact pairs_;
  Work work_;
  std::vector<Turn> turns_;
  std::vector<glm::dvec3> predicted_;
  std::size_t threads_;
};

}  // namespace

Solver create_cpu_fast_solver(const SolverInput& input) {
  Solver solver;
  solver.substep = [pbd = std::make_shared<FastPbd>(input)](Sim& sim, int) {
    pbd->change_model(*sim.model);
    add_guards(sim, pbd->step(sim.host, sim.settings, sim.inverse_masses, simulated_time(sim)));
  };
  return solver;
}

}  // namespace tetpbd
