// Gauss-Seidel by colours on all CPU cores (method.md, mode cpu-fast): the batches of a colour are shared out among
// threads. Who solves a batch changes nothing in it, so results do not depend on the number of threads.
#include <omp.h>

#include <algorithm>
#include <memory>

#include "sim/model/attachments.h"
#include "sim/sim.h"
#include "sim/solvers/barrier.h"
#include "sim/solvers/colours.h"
#include "sim/solvers/cpu_batches.h"

// The widest vector instructions that the machine has, chosen when the program starts. Other compilers and processors
// get what the build is for.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDEST [[gnu::target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default"), gnu::flatten]]
#else
#define WIDEST
#endif

namespace tetpbd {

namespace {

WIDEST void project_kind(batches::Work& work, int kind, std::size_t begin, std::size_t end, const Rule<float>& rule,
                         bool first, GuardCounts& guards) {
  for_each_kind([&](auto is, int number) __attribute__((always_inline)) {
    if (number != kind) return;
    if (!work.starts.empty())
      batches::project_batches<decltype(is), true>(work, begin, end, rule, first, guards);
    else
      batches::project_batches<decltype(is), false>(work, begin, end, rule, first, guards);
  });
}

// The batches of a kind that have one colour.
struct Colour {
  int kind;
  std::size_t begin, end;
};

class FastPbd {
 public:
  FastPbd(const SolverInput& input)
      : model_(&input.model),
        pairs_(input.model),
        faces_(wide_faces(input.model)),
        rigid_(input.model, input.system),
        load_mesh_(lay_out_loads(input.model)),
        fibres_(input.system.lists[std::size_t(index_of<Fibre>)]) {
    std::size_t all = 0;
    for_each_kind([&](auto is, int kind) {
      const auto& batches = std::get<batches::Batches<decltype(is)>>(work_.batches);
      const auto [list, first] = coloured(input.system.lists[std::size_t(kind)], input.model.positions.size());
      for (std::size_t colour = 0; colour + 1 < first.size(); ++colour) {
        const std::size_t before = batches.size(), end = first[colour + 1];
        for (std::size_t begin = first[colour], next; begin < end; begin = next) {
          next = batches::find_batch_end(list, begin, end);
          batches::add_batch<decltype(is)>(work_, list, begin, next);
        }
        colours_.push_back({kind, before, batches.size()});
      }
      all += batches.size();
    });
    const std::size_t useful = all / (batches_of_a_useful_thread * std::max<std::size_t>(colours_.size(), 1));
    const std::size_t cores = std::size_t(std::max(omp_get_num_procs(), 1));
    threads_ = input.tuning.threads ? input.tuning.threads : std::clamp<std::size_t>(useful, 1, cores);
  }

  void change_model(const Model& model) { model_ = &model, pairs_.change_model(model), faces_ = wide_faces(model); }

  /// Takes the step of CpuPbd::step, with constraints in another order.
  GuardCounts step(State& state, const Settings& settings, const std::vector<double>& inverse_masses, double time) {
    const Plan plan = plan_for(settings);
    Shared step{state, settings, plan, inverse_masses, {*model_, settings, plan, time}, Barrier(threads_)};
    rigid_.begin(*model_, settings);
    auto& x = work_.x;
    x.resize(state.positions.size());
    work_.starts.resize(any_material(settings, damped) ? x.size() : 0);
    predicted_.resize(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) x[i].row[3] = inverse_masses[i];
    if (step.substep.books_work()) state.work.resize(x.size());
    read_positions(state);
    adopt_rest_metrics(state);
    if (!model_->fibres.empty()) activate(state, activations_of_step(*model_, settings, time));
    pairs_.begin_step(state);
// Loops inside the region itself would be 4 % slower on one thread.
#pragma omp parallel num_threads(int(threads_))
    {
#pragma omp single
      step.barrier.threads = std::size_t(omp_get_num_threads());
      step.barrier.run([&] { run_substeps(step, std::size_t(omp_get_thread_num())); });
    }
    step.barrier.rethrow();
    write_positions(state);
    pairs_.end_step(state);
    return step.guards;
  }

 private:
  void adopt_rest_metrics(const State& state) {
    if (state.rest_metrics.empty()) return;
    auto& all = std::get<batches::Batches<NeoHookean>>(work_.batches);
    constexpr std::size_t lanes = batches::lanes;
    if (tets_.empty())
      tets_ = find_tets(model_->rest, lanes * all.size(), [&](std::size_t k) {
        const auto& v = all[k / lanes].vertices;
        return Tet{v[0][k % lanes], v[1][k % lanes], v[2][k % lanes], v[3][k % lanes]};
      });
    for (std::size_t k = 0; k < tets_.size(); ++k)
      for (std::size_t m = 0; m < 6; ++m)
        all[k / lanes].rest[m][k % lanes] = float(state.rest_metrics[6 * tets_[k] + m]);
  }
  void activate(State& state, const Activations& step) {
    state.work[0] += activation_work(fibres_, step, state.positions);
    for (auto& batch : std::get<batches::Batches<Fibre>>(work_.batches))
      for (std::size_t lane = 0; lane < batches::lanes; ++lane)
        batch.rest[3][lane] = 1 - step.now[std::size_t(batch.rest[4][lane])];
  }

  // How many batches of a colour a thread needs on average: a batch takes about 0.2 us, and a barrier, with fetching
  // what other threads have moved, about 2 us.
  static constexpr std::size_t batches_of_a_useful_thread = 2;

  // What the threads of a step share.
  struct Shared {
    State& state;
    const Settings& settings;
    const Plan& plan;
    const std::vector<double>& inverse_masses;
    Substep substep;
    Barrier barrier;
    GuardCounts guards{};
  };

  void read_positions(const State& state) {
    for (std::size_t i = 0; i < work_.x.size(); ++i) work_.x[i].move_to(state.positions[i]);
  }
  void write_positions(State& state) const {
    for (std::size_t i = 0; i < work_.x.size(); ++i) state.positions[i] = work_.x[i].position();
  }

  // A thread's part of a step.
  void run_substeps(Shared& step, std::size_t thread) {
    Substep& substep = step.substep;
    Barrier& barrier = step.barrier;
    auto& x = work_.x;
    auto& v = step.state.velocities;
    auto& done = step.state.work;
    const std::size_t begin = x.size() * thread / barrier.threads, end = x.size() * (thread + 1) / barrier.threads;
    const auto for_each_free_vertex = [&](auto&& act) {
      for (std::size_t i = begin; i < end; ++i)
        if (step.inverse_masses[i] > 0) act(i);
    };
    GuardCounts counts{};
    for (int s = 0; s < step.plan.substeps; ++s) {
      if (!work_.starts.empty()) std::copy_n(x.data() + begin, end - begin, work_.starts.data() + begin);
      if (rigid_.wanted() || (substep.moving && s > 0) || !load_mesh_.empty()) {
        barrier.wait(thread);
        if (thread == 0)
          substep.begin(s),
              substep.find_loads(
                  load_mesh_, [&](std::uint32_t i) { return x[i].position(); }, v),
              rigid_.prepare(substep, step.inverse_masses, work_, v, done, counts, pairs_.wrenches());
        barrier.wait(thread);
      }
      if (thread == 0)
        pairs_.begin(step.settings, step.state.positions, v);  // of the step's start, then of the last resolve()
      if (bodies_touch(*model_, step.settings)) barrier.wait(thread);  // prediction changes velocities
      for (std::size_t i = begin; i < end; ++i) {
        const bool free = step.inverse_masses[i] > 0;
        predicted_[i] = free ? rigid_.predict(substep, i, x[i].position(), v[i]) : x[i].position() + substep.h * v[i];
        x[i].move_to(predicted_[i]);
      }
      for (int iteration = 0; iteration < step.plan.iterations; ++iteration) {
        solve(step, thread, iteration == 0, counts);
        for_each_free_vertex([&](std::size_t i) {
          double* work = substep.moving && !rigid_.carries(i) ? &done[i] : nullptr;
          x[i].move_to(substep.out_of_obstacles(i, x[i].position(), predicted_[i], v[i], work));
        });
      }
      for_each_free_vertex([&](std::size_t i) {
        v[i] = rigid_.velocity_after(substep, i, x[i].position(), predicted_[i], v[i]);
        substep.book_loads(i, v[i], done);
      });
      const bool faces = !faces_.empty() && are_faces_due(step.plan, s);
      if (bodies_touch(*model_, step.settings) || faces) {
        barrier.wait(thread);
        if (thread == 0) {
          write_positions(step.state);
          if (faces)
            move_faces_out(*model_, step.settings, faces_, substep.obstacles, substep.h, step.state.positions, v,
                           step.inverse_masses, done);
          pairs_.resolve(step.settings, step.state.positions, v, step.inverse_masses, substep.h,
                         substep.h / OffsetContact::recovery, rigid_.carried());
          read_positions(step.state);
        }
        barrier.wait(thread);
      }
    }
#pragma omp critical
    for (std::size_t g = 0; g < counts.size(); ++g) step.guards[g] += counts[g];
  }

  // One iteration's constraints, colour after colour. Small colours are left to the first thread, because neighbours
  // among them then need no barrier.
  void solve(Shared& step, std::size_t thread, bool first, GuardCounts& guards) {
    bool shared_before = true;
    for (const Colour& colour : colours_) {
      const std::size_t count = colour.end - colour.begin, threads = step.barrier.threads;
      const bool shared = count >= threads;
      if (shared || shared_before) step.barrier.wait(thread);
      shared_before = shared;
      if (!shared && thread > 0) continue;
      const std::size_t begin = colour.begin + (shared ? count * thread / threads : 0);
      const std::size_t end = colour.begin + (shared ? count * (thread + 1) / threads : count);
      const Rule<float> rule(step.settings, step.plan.h, std::size_t(colour.kind), model_->size);
      project_kind(work_, colour.kind, begin, end, rule, first, guards);
    }
    step.barrier.wait(thread);
  }

  const Model* model_;
  OffsetContact pairs_;
  std::vector<Triangle> faces_;
  RigidContact rigid_;
  batches::Work work_;
  std::vector<Colour> colours_;
  std::vector<glm::dvec3> predicted_;
  std::vector<glm::uvec4> load_mesh_;
  ConstraintList fibres_;
  std::vector<std::uint32_t> tets_;  // of neo-Hookean lanes, once any has flowed
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
