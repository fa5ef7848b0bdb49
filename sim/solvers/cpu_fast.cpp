// Coloured Gauss-Seidel on all CPU cores (method.md, mode cpu-fast): batches of constraints of
// one colour are evaluated in the lanes of vector instructions, and batches of a colour are shared out among
// threads. Who solves a batch changes nothing in it, so results do not depend on the number of threads.
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

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

template <class Kind>
struct LaneBatch {
  std::uint32_t vertices[std::size_t(Kind::row.arity)][lanes];
  float rest[lanes];
  std::uint32_t count;  // lanes in use; the others repeat the first
};

template <class Kind>
struct LaneBatches {
  std::vector<LaneBatch<Kind>> batches;
  std::vector<std::size_t> first;                     // of each colour, and the end
  std::vector<std::array<float, lanes>> multipliers;  // of compliant constraints, in this substep
};

// Rules that are compiled: without compliance, with it, and with constraint damping too.
enum class Soft { no, yes, damped };
// What a kind's constraints share.
struct Rule {
  float k, a, gamma;  // stiffness, alpha / h^2, tau / h
  bool soft, first;   // compliant; iteration of the substep: multipliers begin at 0
};

using AllBatches = decltype([]<class... Kind>(std::tuple<Kind...>) {
  return std::tuple<LaneBatches<Kind>...>();
}(Kinds()));

// As an element of std::vector a bare Row would have the alignment of a double (GCC 12).
struct alignas(sizeof(Row)) Vertex {
  Row row;
};

struct Work {
  AllBatches batches;
  std::vector<Vertex> x;
  std::vector<Vertex> start;  // of the substep, with constraint damping
  float limit = 0;            // m, longest correction
};

template <class Kind>
LaneBatches<Kind> cut(const ConstraintList& list, std::size_t vertices) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  LaneBatches<Kind> result;
  const Coloured colours = coloured(list, vertices);
  for (std::size_t colour = 0; colour + 1 < colours.first.size(); ++colour) {
    result.first.push_back(result.batches.size());
    const std::size_t end = colours.first[colour + 1];
    for (std::size_t begin = colours.first[colour]; begin < end; begin += lanes) {
      LaneBatch<Kind>& batch = result.batches.emplace_back();
      batch.count = std::uint32_t(std::min(lanes, end - begin));
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        const std::size_t c = begin + (lane < batch.count ? lane : 0);
        for (std::size_t j = 0; j < arity; ++j)
          batch.vertices[j][lane] = colours.list.vertices[c * arity + j];
        batch.rest[lane] = float(colours.list.rest[c]);
      }
    }
  }
  result.first.push_back(result.batches.size());
  return result;
}

// A batch where a guard triggers: one constraint after the other, as in CpuPbd. `multipliers`: with
// compliance.
template <class Kind, bool damped>
[[gnu::noinline]] void project_guarded(const LaneBatch<Kind>& batch, Work& work, const Rule& rule,
                                       float* multipliers, GuardCounts& guards) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  const float share = 1 + rule.gamma;
  Formulas<float> formulas;
  for (std::size_t lane = 0; lane < batch.count; ++lane) {
    glm::vec3 local[arity];
    [[maybe_unused]] glm::vec3 start[arity];
    float w[arity];
    std::uint32_t ids[arity];
    for (std::size_t j = 0; j < arity; ++j) {
      ids[j] = batch.vertices[j][lane];
      const Row &x = work.x[ids[j]].row, &origin = work.x[ids[0]].row;
      for (int a = 0; a < 3; ++a) local[j][a] = float(x[a] - origin[a]);
      w[j] = float(x[3]);
      if constexpr (damped)
        for (int a = 0; a < 3; ++a)
          start[j][a] = float(work.start[ids[j]].row[a] - work.start[ids[0]].row[a]);
    }
    auto c = Kind::template evaluate<float>(local, batch.rest[lane], ids);
    if constexpr (damped)
      c.C += rule.gamma * (c.C - Kind::template evaluate<float>(start, batch.rest[lane], ids).C);
    const float before = rule.first ? 0 : multipliers[lane];
    c.C += rule.a * before;
    const float lambda = formulas.multiplier(c, w, rule.k, work.limit, rule.a, share);
    const std::uint32_t triggered = formulas.guards_of(c, w, rule.k, work.limit, rule.a, share);
    if (rule.soft) multipliers[lane] = before + lambda;
    for (std::size_t j = 0; lambda != 0 && j < arity; ++j)
      for (int a = 0; a < 3; ++a) work.x[ids[j]].row[a] += double(lambda * w[j] * c.gradient[j][a]);
    for (std::size_t g = 0; g < GUARDS; ++g) guards[g] += triggered >> g & 1;
  }
}

inline void store(float* to, FloatRow row) { std::memcpy(to, &row, sizeof row); }
inline FloatRow load(const float* from) {
  FloatRow row;
  std::memcpy(&row, from, sizeof row);
  return row;
}

// By vertex and lane: first positions relative to the first vertex and inverse masses, then corrections.
template <class Kind>
using Rows = float[std::size_t(Kind::row.arity)][lanes][4];

template <class Kind>
[[gnu::always_inline]] inline void gather(const LaneBatch<Kind>& batch, const std::vector<Vertex>& x,
                                          Rows<Kind>& rows) {
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    Row origin = x[batch.vertices[0][lane]].row;
    store(rows[0][lane], FloatRow{0, 0, 0, float(origin[3])});
    origin[3] = 0;
    for (std::size_t j = 1; j < std::size_t(Kind::row.arity); ++j)
      store(rows[j][lane], __builtin_convertvector(x[batch.vertices[j][lane]].row - origin, FloatRow));
  }
}

template <class Kind>
[[gnu::always_inline]] inline void scatter(const LaneBatch<Kind>& batch, Work& work, const Rows<Kind>& rows) {
  for (std::size_t lane = 0; lane < batch.count; ++lane)
    for (std::size_t j = 0; j < std::size_t(Kind::row.arity); ++j)
      work.x[batch.vertices[j][lane]].row += __builtin_convertvector(load(rows[j][lane]), Row);
}

// Corrections in place of positions; whether a guard may have triggered: then multipliers stay as they
// were.
template <class Kind, Soft soft>
[[gnu::always_inline]] inline bool evaluate(const LaneBatch<Kind>& batch, float limit, const Rule& rule,
                                            Rows<Kind>& rows, [[maybe_unused]] const Rows<Kind>& starts,
                                            [[maybe_unused]] float* multipliers) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  static constexpr std::uint32_t no_ids[4] = {};  // for guards' directions only, and those are not used here
  // What tells whether a guard may have triggered. Kept by lane and looked at below: in the loop itself, bits
  // of guards keep GCC 12 from vectorising it.
  std::uint32_t guard[lanes];
  float error[lanes], multiplier[lanes], slack[lanes], longest[lanes];
  [[maybe_unused]] float before[lanes];
  if constexpr (soft != Soft::no)
    for (std::size_t lane = 0; lane < lanes; ++lane) before[lane] = rule.first ? 0 : multipliers[lane];
  const float k = rule.k, a = rule.a, gamma = rule.gamma;
  Formulas<float, LaneMath> formulas;
#pragma GCC ivdep
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    glm::vec3 x[arity];
    float w[arity];
#pragma GCC unroll 4
    for (std::size_t j = 0; j < arity; ++j) {
      x[j] = glm::vec3(rows[j][lane][0], rows[j][lane][1], rows[j][lane][2]);
      w[j] = rows[j][lane][3];
    }
    auto c = Kind::template evaluate<float, LaneMath>(x, batch.rest[lane], no_ids);
    if constexpr (soft == Soft::damped) {
      glm::vec3 start[arity];
#pragma GCC unroll 4
      for (std::size_t j = 0; j < arity; ++j)
        start[j] = glm::vec3(starts[j][lane][0], starts[j][lane][1], starts[j][lane][2]);
      c.C += gamma * (c.C - Kind::template evaluate<float, LaneMath>(start, batch.rest[lane], no_ids).C);
    }
    float lambda;
    if constexpr (soft == Soft::no) {
      lambda = formulas.multiplier(c, w, k, limit, 0.0f, 1.0f);
    } else {
      c.C += a * before[lane];
      lambda = formulas.multiplier(c, w, k, limit, a, 1 + gamma);
    }
    float sum = 0, weights = 0, most = 0;
#pragma GCC unroll 4
    for (std::size_t j = 0; j < arity; ++j) {
      const float share = lambda * w[j], square = glm::dot(c.gradient[j], c.gradient[j]);
      rows[j][lane][0] = share * c.gradient[j].x;
      rows[j][lane][1] = share * c.gradient[j].y;
      rows[j][lane][2] = share * c.gradient[j].z;
      rows[j][lane][3] = 0;
      sum += w[j] * square;
      weights += w[j];
      most = glm::max(most, share * share * square);
    }
    guard[lane] = c.guards;
    error[lane] = c.C;
    multiplier[lane] = lambda;
    slack[lane] = sum - c.floor * 0.25f * weights;
    longest[lane] = most;
  }
  std::uint32_t triggered = 0;
  for (std::size_t lane = 0; lane < lanes; ++lane)
    triggered |= guard[lane] | std::uint32_t(!(slack[lane] >= 0)) |
                 std::uint32_t(!(longest[lane] < 0.99f * limit * limit)) |
                 (std::uint32_t(error[lane] != 0) & std::uint32_t(multiplier[lane] == 0));
  if constexpr (soft != Soft::no)
    if (!triggered)
      for (std::size_t lane = 0; lane < lanes; ++lane) multipliers[lane] = before[lane] + multiplier[lane];
  return triggered != 0;
}

// Batches [begin, end) of a kind.
template <class Kind, Soft soft>
[[gnu::always_inline]] inline void project_batches(Work& work, std::size_t begin, std::size_t end,
                                                   const Rule& rule, GuardCounts& guards) {
  constexpr bool damped = soft == Soft::damped;
  // Some batches together: reading a row's floats as vectors right after storing the row would wait for the
  // stores.
  constexpr std::size_t together = 4;
  auto& of_kind = std::get<LaneBatches<Kind>>(work.batches);
  const LaneBatch<Kind>* batches = of_kind.batches.data();
  const auto multipliers = [&](std::size_t b) { return of_kind.multipliers[rule.soft ? b : 0].data(); };
  for (std::size_t b = begin; b < end; b += together) {
    const std::size_t count = std::min(together, end - b);
    Rows<Kind> rows[together];
    [[maybe_unused]] Rows<Kind> starts[damped ? together : 1];
    bool guarded[together];
    for (std::size_t i = 0; i < count; ++i) gather(batches[b + i], work.x, rows[i]);
    if constexpr (damped)
      for (std::size_t i = 0; i < count; ++i) gather(batches[b + i], work.start, starts[i]);
    for (std::size_t i = 0; i < count; ++i)
      guarded[i] = evaluate<Kind, soft>(batches[b + i], work.limit, rule, rows[i], starts[damped ? i : 0],
                                        multipliers(b + i));
    for (std::size_t i = 0; i < count; ++i)
      if (guarded[i])
        project_guarded<Kind, damped>(batches[b + i], work, rule, multipliers(b + i), guards);
      else
        scatter(batches[b + i], work, rows[i]);
  }
}

// By the kind's number.
WIDEST void project(Work& work, int kind, std::size_t begin, std::size_t end, const Rule& rule,
                    GuardCounts& guards) {
  for_each_kind([&](auto is, int number) __attribute__((always_inline)) {
    if (number != kind) return;
    if (!rule.soft)
      project_batches<decltype(is), Soft::no>(work, begin, end, rule, guards);
    else if (rule.gamma > 0)
      project_batches<decltype(is), Soft::damped>(work, begin, end, rule, guards);
    else
      project_batches<decltype(is), Soft::yes>(work, begin, end, rule, guards);
  });
}

// A colour of a kind: batches [begin, end).
struct Turn {
  int kind;
  std::size_t begin, end;
};

class FastPbd {
 public:
  FastPbd(const SolverInput& input) : model_(input.model) {
    std::size_t batches = 0;
    for_each_kind([&](auto is, int kind) {
      auto& of_kind = std::get<LaneBatches<decltype(is)>>(work_.batches);
      of_kind = cut<decltype(is)>(input.system.lists[std::size_t(kind)], input.model.positions.size());
      for (std::size_t colour = 0; colour + 1 < of_kind.first.size(); ++colour)
        turns_.push_back({kind, of_kind.first[colour], of_kind.first[colour + 1]});
      batches += of_kind.batches.size();
    });
    work_.limit = float(input.model.size);
    const std::size_t useful =
        batches / (batches_of_a_useful_thread * std::max<std::size_t>(turns_.size(), 1));
    const std::size_t cores = std::size_t(std::max(omp_get_num_procs(), 1));
    guards_.resize(input.tuning.threads ? input.tuning.threads : std::clamp<std::size_t>(useful, 1, cores));
  }

  GuardCounts guards() const {
    GuardCounts sum{};
    for (const GuardCounts& of_thread : guards_)
      for (std::size_t g = 0; g < GUARDS; ++g) sum[g] += of_thread[g];
    return sum;
  }

  /// As CpuPbd::step, in another order.
  void step(State& state, const Settings& settings, const std::vector<double>& inverse_masses) {
    const double h = settings.dt / settings.substeps;
    const glm::dvec3 gravity(0, -settings.gravity, 0);
    const std::vector<glm::dvec4> planes = planes_of(model_, settings);
    const double velocity_scale = std::exp(-settings.damping * h);
    auto& v = state.velocities;
    auto& x = work_.x;
    const bool soft = compliant(settings), slow = damped(settings);
    for_each_kind([&](auto is, int) {
      auto& of_kind = std::get<LaneBatches<decltype(is)>>(work_.batches);
      of_kind.multipliers.resize(soft ? of_kind.batches.size() : 1);
    });
    work_.start.resize(slow ? state.positions.size() : 0);
    x.resize(state.positions.size());
    predicted_.resize(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      const glm::dvec3& p = state.positions[i];
      x[i].row = Row{p.x, p.y, p.z, inverse_masses[i]};
    }
    const auto position = [&](std::size_t i) { return glm::dvec3(x[i].row[0], x[i].row[1], x[i].row[2]); };
    const auto move_to = [&](std::size_t i, const glm::dvec3& p) {
      x[i].row = Row{p.x, p.y, p.z, inverse_masses[i]};
    };
    const auto substeps = [&](std::size_t thread, std::size_t threads) {
      const std::size_t begin = x.size() * thread / threads, end = x.size() * (thread + 1) / threads;
      const auto for_each_free_vertex = [&](auto&& act) {
        for (std::size_t i = begin; i < end; ++i)
          if (inverse_masses[i] > 0) act(i);
      };
      for (int s = 0; s < settings.substeps; ++s) {
        if (slow)
          std::copy(x.begin() + long(begin), x.begin() + long(end), work_.start.begin() + long(begin));
        for_each_free_vertex([&](std::size_t i) {
          v[i] = (v[i] + h * gravity) * velocity_scale;
          move_to(i, position(i) + h * v[i]);
          predicted_[i] = position(i);
        });
        for (int iteration = 0; iteration < settings.iterations; ++iteration) {
          solve(settings, thread, threads, soft, iteration == 0);
          for_each_free_vertex([&](std::size_t i) {
            move_to(i, out_of(planes, position(i), predicted_[i], h * v[i], settings.friction));
          });
        }
        for_each_free_vertex([&](std::size_t i) { v[i] += (position(i) - predicted_[i]) / h; });
      }
    };
// Loops inside the region itself would be 4 % slower on one thread.
#pragma omp parallel num_threads(int(guards_.size()))
    substeps(std::size_t(omp_get_thread_num()), std::size_t(omp_get_num_threads()));
    for (std::size_t i = 0; i < x.size(); ++i) state.positions[i] = position(i);
  }

 private:
  // A colour's batches take about 0.2 us each, a barrier one to several.
  static constexpr std::size_t batches_of_a_useful_thread = 16, batches_worth_a_barrier = 4;

  // One iteration's constraints, colour after colour. Small colours are left to the first thread: neighbours
  // among them then need no barrier.
  void solve(const Settings& settings, std::size_t thread, std::size_t threads, bool soft, bool first) {
    const double h = settings.dt / settings.substeps;
    bool shared_before = true;
    for (const Turn& turn : turns_) {
      const std::size_t count = turn.end - turn.begin;
      const bool shared = count >= batches_worth_a_barrier * threads;
      if (shared || shared_before) {
#pragma omp barrier
      }
      shared_before = shared;
      if (!shared && thread > 0) continue;
      const std::size_t begin = shared ? count * thread / threads : 0;
      const std::size_t end = shared ? count * (thread + 1) / threads : count;
      const std::size_t kind = std::size_t(turn.kind);
      const Rule rule{float(settings.stiffness[kind]), float(settings.compliance[kind] / (h * h)),
                      float(settings.constraint_damping / h), soft, first || !soft};
      project(work_, turn.kind, turn.begin + begin, turn.begin + end, rule, guards_[thread]);
    }
#pragma omp barrier
  }

  const Model& model_;
  Work work_;
  std::vector<Turn> turns_;
  std::vector<glm::dvec3> predicted_;
  std::vector<GuardCounts> guards_;  // by thread
};

}  // namespace

Solver create_cpu_fast_solver(const SolverInput& input) {
  Solver solver;
  const auto pbd = std::make_shared<FastPbd>(input);
  solver.step_on_cpu = [pbd](State& state, const Settings& settings,
                             const std::vector<double>& inverse_masses) {
    pbd->step(state, settings, inverse_masses);
  };
  solver.guards_on_cpu = [pbd] { return pbd->guards(); };
  return solver;
}

}  // namespace tetpbd
