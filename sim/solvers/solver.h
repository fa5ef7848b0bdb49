// Solver modes: how one substep's constraints are solved. A mode is a file of this folder and a row in
// solver.cpp; what several share stands here and in jacobi.h.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/gl/layout.h"
#include "sim/gl/pass.h"
#include "sim/model/constraints.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"

namespace tetpbd {

struct Sim;
struct Carried;

/// How often each guard of layout.glsl triggered, in its order. A projection counts once where each
/// constraint is evaluated once (constraint and cpu modes), and once a vertex of it in node mode.
/// Behind them, what was left out (DROP_...).
using GuardCounts = std::array<std::uint64_t, GUARDS + DROPS>;
inline constexpr std::array<const char*, GUARDS> guard_names = {"direction", "hinge", "angle",     "volume_floor",
                                                                "collapsed", "limit", "not_finite"};
inline constexpr std::array<const char*, DROPS> drop_names = {"rigid_contacts", "rigid_sweeps", "rigid_range"};

/// What a mode does with a simulation; its file makes it, with whatever else it keeps inside these functions.
struct Solver {
  std::vector<Buffer> buffers;
  std::vector<std::pair<std::string, GLuint>> bindings;  ///< of blocks, beside those every mode shares
  /// Of quantized positions: none; one, that is read and written by turns; two where an iteration reads one
  /// and writes the other.
  int quantized_buffers = 0;
  bool keeps_prediction = false;   ///< from the first iteration of a substep to the last
  std::size_t vertex_patches = 0;  ///< so many own the vertices (block Patches)

  /// Of a state that is given; nothing is known of steps before.
  std::function<void(Sim&, const State&)> start = [](Sim&, const State&) {};
  /// After a change from outside and before the next step: what neighbours see of the vertices.
  std::function<void(Sim&)> predict = [](Sim&) {};
  /// Before a step: answers of steps before, the plan, the preconditioner.
  std::function<void(Sim&)> prepare = [](Sim&) {};
  /// One substep, by number; of a mode on the CPU all of them.
  std::function<void(Sim&, int)> substep;
  /// Other settings than `before`, whose kernels are the same; null: the first. Throws Error where they do
  /// not do.
  std::function<void(Sim&, const Settings* before)> retune = [](Sim&, const Settings*) {};
  bool takes_constraints = false;  ///< retune() takes other numbers of the same constraints
  /// What is made for a plan, at once for that of now.
  std::function<void(Sim&)> refresh = [](Sim&) {};
  bool watches = false;  ///< kernels note what the number of substeps follows (adaptive_substeps.h)
  /// What a step hands on beside what every mode has.
  std::function<void(Sim&, Carried&)> carried = [](Sim&, Carried&) {};
};

/// How kernels are cut into invocations; 0: by the mesh's size or the driver's limit. For measurements and
/// tests.
struct Tuning {
  unsigned group = 0;         ///< invocations of a work-group of the solving kernel, a power of two up to 1024
  unsigned patch = 0;         ///< constraints of a patch in mode constraint, vertices of one in mode node
  unsigned row = 0;           ///< most work-groups in a dispatch's first dimension
  std::size_t storage = 0;    ///< most bytes of a storage buffer
  unsigned lanes = 0;         ///< invocations that look for what a vertex touches, a power of two up to 8
  unsigned threads = 0;       ///< of mode cpu-fast; 0: as many as the machine has cores and work is for
  bool count_guards = false;  ///< GPU kernels count how often each guard triggers (CPU modes always do)
};
/// From the variable TETPBD_TUNE, as in "patch=8,group=128"; throws Error for anything else.
Tuning tuning_from_environment();

struct SolverInput {
  const Model& model;
  const ConstraintSystem& system;
  const Settings& settings;
  Plan plan;
  Tuning tuning;           ///< `row` and `storage` filled in
  bool software = false;   ///< the "GPU" is a CPU
  bool compliant = false;  ///< settings.h
  bool rigid = false;      ///< rigid_in_contact(), settings.h
};

/// A row of the table: what the mode is called, what makes it, and what it can do.
struct SolverMode {
  const char* name = "";
  const char* help = "";
  Solver (*create)(const SolverInput&) = nullptr;
  bool compliance = true;             ///< and compliance
  bool implicit = false;              ///< forces, in implicit steps
  bool leapfrog = false;              ///< forces in place of corrections: substeps are as many as stay stable
  bool pairs = false;                 ///< and contact between bodies
  bool jacobi = false;                ///< corrections are averaged or masses split
  bool cpu = false;                   ///< steps on the CPU: `Sim::host` is the state
  bool all_cores = false;             ///< of it
  bool published = false;             ///< as in the paper: corrections are averaged, hard bodies rebound by them
  bool offered = true;                ///< in --mode and the window; else in bench and compare alone
  int iterations = 1, substeps = 20;  ///< where nothing is asked for; of leapfrog the least, 1
  /// Whether iterations and substeps mean the same in both: corrections, leapfrog or implicit steps.
  bool solves_like(const SolverMode& other) const { return leapfrog == other.leapfrog && implicit == other.implicit; }
};
/// Those that are offered.
const std::vector<SolverMode>& solver_modes();
/// Of all modes; nullptr if there is none.
const SolverMode* find_solver_mode(const std::string& name);
/// Of a baseline that compare runs beside modes: a row that can do nothing.
const SolverMode& solver_mode(const Settings& settings);

/// SCHEME: the file of shaders/solvers/ that says how a vertex moves.
ShaderWords scheme_words(const SolverInput& input);
/// Definitions for the shaders that move vertices (vertex.glsl).
std::vector<std::string> vertex_defines(const SolverInput& input);
/// Words for the shaders of the kinds present: KIND, ARITY, INDEX (among those present), KIND_ROW and
/// KIND_COLUMN (of the stiffness), PAIRS (of a record), MATERIAL (1: it has compliances of its own), OWN
/// (1: and k and damping), PROJECT (the file that projects it), RATE (1: only its change counts), VALUES (at
/// rest).
std::vector<Substitutions> kind_words(const ConstraintSystem& system);
/// The records of one list (layout.glsl: Record2, Record4).
Buffer record_buffer(const ConstraintList& list, const std::string& kind);
/// Throws Error if a buffer is larger than a storage block may be.
void check_storage(const Tuning& tuning, const std::string& label, std::size_t bytes);
/// A buffer of the solver, which its kernels know by the name of a block.
void add_buffer(Solver& solver, const Tuning& tuning, const char* block, Buffer buffer);

/// How constraints are cut: `patch` as in Tuning, invocations of a work-group.
struct Cut {
  unsigned patch, group;
};
/// With what `tuning` overrides; throws Error if a work-group cannot have that size.
Cut tuned(Cut cut, const Tuning& tuning);

}  // namespace tetpbd
