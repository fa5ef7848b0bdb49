// A simulation: a model, settings, GPU buffers and the passes of a step. Any number can live side by side. Callers use
// these functions and read the members, which only these functions write.
//
// In a program that uses GL itself, a simulation belongs to the context that is current when it is made, which has to
// be current in each call and when it is destroyed; a step may be taken in another one that shares its objects, if it
// is not timed and the GPU has done what the first context queued. A call leaves the program in use, textures and the
// buffers of generic targets bound as before (keep_bindings.h) and touches nothing else that drawing uses, such as
// vertex arrays.
//
// Indexed buffers are not put back, because there are too many to ask for: calls bind uniform buffers 0 and 1, storage
// buffers from 0 on and atomic counter buffer 0. When a simulation is destroyed, GL unbinds its buffers there, and Mesa
// then unbinds that of the generic target as well. GL errors that nobody asked for are dropped.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sim/adaptive_substeps.h"
#include "sim/carried.h"
#include "sim/contact/faces.h"
#include "sim/contact/obstacles.h"
#include "sim/contact/pairs.h"
#include "sim/finite_check.h"
#include "sim/gl/gpu.h"
#include "sim/gl/layout.h"
#include "sim/loads.h"
#include "sim/model/model.h"
#include "sim/solvers/mass_scaling.h"
#include "sim/solvers/solver.h"
#include "sim/yielding.h"

namespace tetpbd {

using VertexList = std::vector<std::uint32_t>;

/// Pinned vertices and where they are to be at the end of the next step, m (led.cpp): those of the model's fixtures,
/// and where a caller wants others.
struct Led {
  bool by_hand = false;  ///< some are not of fixtures
  VertexList vertices;
  std::vector<glm::dvec3> places;
  Buffer records;
  std::vector<std::string> defines;
  Pass pass;  ///< made when it is first needed
};

struct Sim : StepValues {
  std::shared_ptr<const Model> model;
  Settings settings;  ///< as the user gave them
  Plan plan;          ///< what the next step takes
  ConstraintSystem system;
  std::vector<double> masses;          ///< kg, the model's, in mode explicit with what mass scaling adds
  std::vector<double> inverse_masses;  ///< 1/kg, of these masses; 0: fixed or pinned
  MassScaling mass_scaling;

  Buffer positions;     ///< Position
  Buffer velocities;    ///< Velocity, and where Solver::keeps_prediction says so predicted positions
  Buffer quantized[2];  ///< positions that neighbours see (quantized.glsl); a solver may read one and write the other
  Buffer step_block;    ///< Step
  Buffer fineness;      ///< quantum_fineness(), where some bodies are far smaller than others
  Texture fineness_texture;
  Obstacles obstacles;
  Buffer guard_counts;  ///< GUARDS counters, where they are counted
  Solver solver;
  Buffer rigid_bodies;       ///< RigidRecord, of hard bodies, and their vertices in contact (contact/rigid.glsl)
  Pass rigid_contact;        ///< before each substep, where there are hard bodies
  Pairs pairs;               ///< contact between bodies, where there is any
  Faces faces;               ///< that obstacles could get in between
  std::vector<char> broken;  ///< by attachment of the model, those that have let go; empty: none
  Led led;
  Loads loads;  ///< where the model has any
  Activation activation;
  Yielding yielding;  ///< where any body yields
  Tuning tuning;
  double longest_substep = 0;       ///< s, the longest that is stable at rest, in mode explicit
  std::int64_t shader_version = 0;  ///< shader_folder_version() at the last build

  State host;   ///< state of a CPU mode; the GPU buffers follow it
  Timer timer;  ///< around the GPU passes of each step, while `timed`
  bool timed = false;
  Recorder recorder;
  GuardCounts guards{};       ///< since the last reset; ask guard_counts()
  FiniteCheck check;          ///< ask check_finite()
  AdaptiveSubsteps adaptive;  ///< ask adaptive_values()
};

/// Throws Error where settings do not go together, or the driver's limits do not allow the size.
Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings,
               const Tuning& tuning = tuning_from_environment());
/// How many substeps mode explicit takes for a step at rest, within some percent. The settings must have forces.
double explicit_substeps(const Model& model, Settings settings);
/// Takes over new settings; positions stay, and velocities become those of the new half substep. Makes the solver again
/// if the mode, the constraint kinds or whether there is compliance changed; where that fails, throws and leaves the
/// simulation as it was.
void apply_settings(Sim& sim, const Settings& settings);
/// Builds the shaders again, after an edit in the shader folder; throws and keeps the old ones if they do not compile.
void rebuild_shaders(Sim& sim);
/// Queues one step on the GPU (CPU modes: steps, then uploads). Does not wait.
void step(Sim& sim);
/// The same, but for attachments that break. Ends between two substeps of a GPU mode where `given_up` says so, and is
/// false then: the simulation can be reset or destroyed, nothing else.
bool step_unless(Sim& sim, const std::function<bool()>& given_up);
/// What a step ends with: lets go of attachments on which the force has become too large, which rebuilds the solver.
void break_attachments(Sim& sim);
/// Back to the model's start.
void reset(Sim& sim);
/// Goes on with these attachments alone let go of.
void set_broken(Sim& sim, const std::vector<char>& broken);

/// Whether the mode steps on the CPU: then `host` is the state.
inline bool on_cpu(const Sim& sim) { return solver_mode(sim.settings).cpu; }

/// s, since the start.
inline double simulated_time(const Sim& sim) {
  return sim.origin.time + double(sim.steps - sim.origin.step) * sim.settings.dt;
}
/// Goes on with a model that differs in its obstacles alone; the state stays. Throws Error where there are too many
/// obstacles, and leaves the simulation as it was.
void change_obstacles(Sim& sim, std::shared_ptr<const Model> model);
/// The carried state in the present mode.
Carried carried(Sim& sim);
/// Forgets all steps so far: time and counts start at 0.
void forget_all(Sim& sim);
/// Goes on from a state whose velocities are behind by `fall` (half_substep_fall()), in m/s.
void start_with(Sim& sim, State state, double fall);
/// m, the quantum of positions that neighbours see.
double choose_quantum(const Sim& sim, const State& state);
/// Tells kernels the settings and the plan. `substeps_before`: of a step, if the plan had others until now, else 0.
void write_step_block(Sim& sim, int substeps_before = 0);
/// For solvers: dispatches a kernel of a substep; `what` and `bytes` as in Recorder::run().
void run_kernel(Sim& sim, Pass& pass, unsigned phases = 0, const char* what = "", std::size_t bytes = 0);
/// For solvers: gives kernels the quantized positions to read and to write.
void give_quantized(Sim& sim);
/// For solvers: the same after a kernel wrote them, so that with two buffers reading and writing change places.
void turn_quantized(Sim& sim);
/// For solvers on the CPU: adds what they counted.
void add_guards(Sim& sim, const GuardCounts& counts);
/// m/s by which velocities of mid-substep are behind those at the substep's end, because of gravity; 0 in modes whose
/// velocities are those at the end.
double half_substep_fall(const Settings& settings, const Plan& plan);
/// Whether a model has the same constraints with both.
bool same_constraints(const Settings& a, const Settings& b);
State make_state(const std::vector<Position>& positions, const std::vector<Velocity>& velocities);
/// Waits for the GPU.
State read_state(const Sim& sim);
/// A state that is not finite is accepted, and check_finite() finds it at once.
void write_state(Sim& sim, const State& state);
/// Splits a value into the sum of two floats.
void split_double_single(const glm::dvec3& value, glm::vec3& high, glm::vec3& low);
void write_velocities(const Sim& sim, const State& state);
/// Writes the GPU's buffers of positions and velocities.
void upload(Sim& sim, const State& state);
/// FNV-1a over the bits of all positions and velocities; equal states give equal hashes. Waits.
std::uint64_t state_hash(const Sim& sim);
/// How often each guard triggered since the start or the last reset; zeros if GPU kernels do not count. Waits.
GuardCounts guard_counts(Sim& sim);
/// How much was left out since then because a fixed size or number of turns did not suffice, by name, without zeros.
/// GPU modes always count it. Waits.
std::vector<std::pair<std::string, std::uint64_t>> dropped(Sim& sim);

/// Starts the check anew with the present state; `given` is that state where it comes from outside and may not be
/// finite, else null.
void start_check(Sim& sim, const State* given);
/// To be called after each step.
void check_step(Sim& sim);
/// The first state that was not finite, as far as is known; with `wait`, of all steps so far. Throws ContextLost.
const std::optional<NonFinite>& check_finite(Sim& sim, bool wait = false);
/// Goes back to the last checkpoint before the state found, at most 64 steps earlier; false where there is none.
bool restore_checkpoint(Sim& sim);

/// Pinned vertices have infinite mass and stay where they are or are led. Any number of them costs one or two writes to
/// the GPU, none of which waits.
void pin(Sim& sim, const VertexList& vertices);
void unpin(Sim& sim, const VertexList& vertices);
inline void pin(Sim& sim, std::uint32_t vertex) { pin(sim, VertexList{vertex}); }
inline void unpin(Sim& sim, std::uint32_t vertex) { unpin(sim, VertexList{vertex}); }
bool is_pinned(const Sim& sim, std::uint32_t vertex);
/// 1/kg, of a vertex while it is not pinned.
double free_inverse_mass(const Sim& sim, std::size_t vertex);
/// In the next step these go to `places`, m, with the velocity that takes, unless what they hit holds them back.
void move_pinned(Sim& sim, const VertexList& vertices, const std::vector<glm::dvec3>& places);
inline void move_pinned(Sim& sim, std::uint32_t vertex, const glm::dvec3& place) {
  move_pinned(sim, VertexList{vertex}, {place});
}
/// m, how far what is in its way holds back a fixture in this state.
double lag_of(const Sim& sim, const Fixture& fixture, const State& state);
/// For a step: before its first substep; before each substep of a GPU mode and once its pairs are listed; and after the
/// last, when the velocities are 0 again where a caller led any.
void begin_leading(Sim& sim);
void aim_led(Sim& sim, int substep);
void lead(Sim& sim, int substep);
void end_leading(Sim& sim);

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
    std::optional<double> ms;  ///< of one dispatch, the mean of those that were timed
  };
  std::vector<Item> buffers;
  std::vector<Kernel> dispatches;
  std::size_t bytes = 0;
  long dispatches_per_step = 0;
  double ms_per_step = 0;
  std::size_t bytes_per_step = 0;  ///< read and written by all dispatches; caches may serve part of it
};
/// What the simulation allocates and dispatches; `timed_steps`: how many were taken with the recorder timing, if any.
/// Waits for what is timed.
Explanation explain(Sim& sim, int timed_steps = 0);

}  // namespace tetpbd
