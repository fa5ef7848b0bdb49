// A simulation: a model, settings, GPU buffers and the passes of a step. Any number can live side by side.
// step.cpp takes steps, sim.cpp makes, sets and reads simulations, finite_check.cpp goes back to good states,
// explain.cpp says what one costs. Whoever uses it calls these functions and reads its members; only they
// write them.
#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sim/carried.h"
#include "sim/finite_check.h"
#include "sim/gl/gpu.h"
#include "sim/layout.h"
#include "sim/model.h"
#include "sim/pairs.h"
#include "sim/solvers/solver.h"
#include "sim/watch.h"

namespace tetpbd {

/// Of what the solver makes for certain forces and substeps, for those of now, in a thread; what it had
/// serves meanwhile. Taken over so many steps later, waiting if need be: runs are the same whatever the
/// machine does.
struct Renewal {
  std::future<std::vector<glm::vec4>> words;
  long steps = 0;      ///< until then
  bool again = false;  ///< settings have changed since
};

struct Sim : StepValues {
  std::shared_ptr<const Model> model;
  Settings settings;  ///< what was asked for
  Plan plan;          ///< what a step takes
  ConstraintSystem system;
  std::vector<double> inverse_masses;  ///< the model's, with pinned vertices 0

  Buffer positions;     ///< Position
  Buffer velocities;    ///< Velocity
  Buffer predicted;     ///< Velocity (a pair as well), from the first iteration of a substep to the last
  Buffer quantized[2];  ///< what neighbours see (quantized.glsl); a double-buffered solver reads one and
                        ///< writes the other
  Buffer step_block;    ///< Step
  Buffer shapes;  ///< Shape: of each obstacle with a shape as it is at the step's start, then at the end of
                  ///< each substep; one list where nothing moves
  Buffer fields;  ///< of shapes, one after the other
  Texture fields_texture;
  int shapes_now = 0;   ///< which list of `shapes` is of the present
  Buffer guard_counts;  ///< GUARDS counters, where they are counted
  Solver solver;
  Buffer
      rigid_bodies;    ///< RigidRecord, of hard bodies in contact (rigid.glsl), and vertices near half spaces
  Pass rigid_contact;  ///< before each substep, where there are any
  Pairs pairs;         ///< contact between bodies, where there is any
  Pass predict;        ///< makes the quantized positions of the next step, after a change from outside
  std::vector<Dispatch> substep;  ///< the dispatches of a substep
  Tuning tuning;
  double longest_substep = 0;       ///< s, that is stable at rest, of mode explicit
  std::int64_t shader_version = 0;  ///< shader_folder_version() at the last build

  State host;   ///< state of a CPU mode; the GPU buffers follow it
  Timer timer;  ///< around the GPU passes of each step, while `timed`
  bool timed = false;
  bool kernels_timed = false;  ///< each dispatch by the timer of its pass
  GuardCounts guards{};        ///< since the last reset; ask guard_counts()
  FiniteCheck check;           ///< ask check_finite()
  Watch watch;                 ///< ask watched()
  Renewal renewal;
};

/// Throws Error where settings do not go together, or the driver's limits do not allow the size.
Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings,
               const Tuning& tuning = tuning_from_environment());
/// How many substeps mode explicit takes of a step at rest, within some percent; settings that have forces.
double explicit_substeps(const Model& model, const Settings& settings);
/// Takes over new settings; positions stay, and velocities are those of the new half substep. Makes the
/// solver again if the mode, the constraint kinds or whether there is compliance changed; where
/// that fails, throws and leaves the simulation as it was.
void apply_settings(Sim& sim, const Settings& settings);
/// Builds the shaders again (after an edit in the shader folder); throws and keeps the old ones if they do
/// not compile.
void rebuild_shaders(Sim& sim);
/// Queues one step on the GPU (CPU modes: steps, then uploads). Does not wait.
void step(Sim& sim);
/// Back to the model's start.
void reset(Sim& sim);

/// Whether the mode steps on the CPU: then `host` is the state.
inline bool on_cpu(const Sim& sim) { return bool(sim.solver.step_on_cpu); }

/// s, since the start.
inline double time_of(const Sim& sim) {
  return sim.origin.time + double(sim.steps - sim.origin.step) * sim.settings.dt;
}
/// The shapes at and after the present, for kernels; a list of them for the next kernels.
void write_shapes(Sim& sim);
/// After those of its model have changed, which the lanes of a window share; `others`: also in number, kind
/// or field. The state stays.
void take_obstacles(Sim& sim, bool others);
void bind_shapes(const Sim& sim, int list);
/// All that a step hands on to the next, as the mode of now has it.
Carried carried(Sim& sim);
/// Of steps so far nothing is known any more.
void forget_all(Sim& sim);
/// Goes on from a state whose velocities were `fall` behind (half_substep_fall()).
void start_with(Sim& sim, State state, double fall);
/// Settings and plan, for the kernels of the next steps.
void write_step_block(Sim& sim, int substeps_before = 0);
/// At once, for the plan of now.
void refresh_preconditioner(Sim& sim);
/// What is known of hard bodies in contact, before something else moves them.
void forget_contacts(Sim& sim);
/// m/s that velocities of mid-substep are behind of those at the substep's end, by gravity; 0 where they are
/// of the end.
double half_substep_fall(const Settings& settings, const Plan& plan);
/// Decides the plan anew from settings, and from what is known of the bodies.
void make_plan(Sim& sim);
State state_of(const std::vector<Position>& positions, const std::vector<Velocity>& velocities);
/// Waits for the GPU.
State read_state(const Sim& sim);
/// A state that is not finite is taken, and found by check_finite() at once.
void write_state(Sim& sim, const State& state);
/// The GPU's buffers of a state that CPU code stepped.
void upload(Sim& sim, const State& state);
/// FNV-1a over the bits of all positions (high and low) and velocities; equal states give equal hashes.
/// Waits.
std::uint64_t state_hash(const Sim& sim);
/// How often each guard triggered since the start or the last reset; zeros if GPU kernels do not count.
/// Waits.
GuardCounts guard_counts(Sim& sim);

/// Starts anew from the state of now, of which nothing is known but that it was `given`, if it was.
void start_check(Sim& sim, const State* given);
/// After a step.
void check_step(Sim& sim);
/// The first state that was not finite, once it is known; with `wait`, of all steps so far. Throws
/// ContextLost.
const std::optional<NonFinite>& check_finite(Sim& sim, bool wait = false);
/// Before a step: asks what kernels noted; in modes explicit and newton takes as many substeps as the last
/// answer needs.
/// Phases of the step's first substep.
unsigned watch(Sim& sim);
void set_stiffening(Sim& sim, double stiffening);
void set_finer(Sim& sim, int times);
/// What kernels noted of other settings or another state.
void forget_answers(Sim& sim);
/// Before a step; and at once, waiting.
void count_down_renewal(Sim& sim);
void finish_renewal(Sim& sim);
/// As of the last step. Waits.
const Watch& watched(Sim& sim);

/// Back to the last good state that was kept, at most 64 steps before the one found, and to its step; false
/// where there is none.
bool restore_checkpoint(Sim& sim);

/// A pinned vertex stays where it is or is put (infinite mass). Does not wait.
void pin(Sim& sim, std::uint32_t vertex);
void unpin(Sim& sim, std::uint32_t vertex);
bool is_pinned(const Sim& sim, std::uint32_t vertex);
/// Puts a pinned vertex somewhere, in metres.
void move_pinned(Sim& sim, std::uint32_t vertex, const glm::dvec3& position);

struct Explanation {
  struct Item {
    std::string name;
    std::size_t bytes;
  };
  struct Kernel {
    std::string name;
    std::size_t work_groups;
    long per_step;             ///< 0: only after a change from outside
    std::size_t bytes;         ///< of one dispatch
    std::optional<double> ms;  ///< of one, the mean of those that were timed
  };
  std::vector<Item> buffers;
  std::vector<Kernel> dispatches;
  std::size_t bytes = 0;
  long dispatches_per_step = 0;
  double ms_per_step = 0;
  std::size_t bytes_per_step = 0;  ///< read and written by all dispatches; caches may serve part of it
};
/// What the simulation allocates and dispatches. Waits for what is timed.
Explanation explain(Sim& sim, int timed_steps = 0);

}  // namespace tetpbd
