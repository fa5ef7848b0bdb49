// Solver modes: how the constraints of a substep are solved. A mode is a file of this folder and a row in solver.cpp;
// what several modes share stands here and in jacobi.h.
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

/// How often each guard of layout.glsl triggered, in its order, and then what was left out (DROP_...). A projection
/// counts once.
using GuardCounts = std::array<std::uint64_t, GUARDS + DROPS>;
inline constexpr std::array<const char*, GUARDS> guard_names = {"direction", "hinge", "angle",     "volume_floor",
                                                                "collapsed", "limit", "not_finite"};
inline constexpr std::array<const char*, DROPS> drop_names = {"rigid_contacts", "rigid_sweeps", "rigid_range",
                                                              "contact_speed"};

/// What a mode does with a simulation. Whatever else it needs it keeps inside these functions.
struct Solver {
  std::vector<Buffer> buffers;
  std::vector<std::pair<std::string, GLuint>> bindings;  ///< of blocks, beside those that every mode has
  /// How many buffers of quantized positions it needs: one is read and written by turns; of two an iteration reads one
  /// and writes the other.
  int quantized_buffers = 0;
  /// Predicted positions stay from the first iteration of a substep to the last, behind the velocities.
  bool keeps_prediction = false;
  /// Where the rest values of neo-Hookean tets stand, for bodies that yield: the name of a block, and of each copy the
  /// constraint and the first word.
  std::string rest_block;
  std::vector<std::array<std::uint32_t, 2>> rest_copies;
  std::size_t vertex_patches = 0;  ///< patches that own the vertices (block Patches), 0: none do

  /// Starts from a state, with nothing known of the steps before it.
  std::function<void(Sim&, const State&)> start = [](Sim&, const State&) {};
  /// After a change from outside, makes what neighbours see of the vertices in the next step.
  std::function<void(Sim&)> predict = [](Sim&) {};
  /// Before a step: takes in readbacks of earlier steps, adapts the plan, refreshes the preconditioner.
  std::function<void(Sim&)> prepare = [](Sim&) {};
  /// One substep, by number; in a mode on the CPU all of them.
  std::function<void(Sim&, int)> substep;
  /// Adopts settings that need no other kernels than those `before`, which is null at first. Throws Error where the
  /// mode cannot solve them.
  std::function<void(Sim&, const Settings* before)> retune = [](Sim&, const Settings*) {};
  std::vector<float> stiffness_shares;  ///< by body, the part of its stiffness that it is given; empty: the whole
  bool takes_constraints = false;       ///< retune() also adopts other values of the same constraints
  /// Makes at once, for the present plan, what prepare() would make over several steps.
  std::function<void(Sim&)> refresh = [](Sim&) {};
  bool watches = false;  ///< kernels note what the number of substeps follows (adaptive_substeps.h)
  /// Adds to the carried state what this mode alone has.
  std::function<void(Sim&, Carried&)> carried = [](Sim&, Carried&) {};
};

/// How kernels are cut into invocations, for measurements and tests; 0: by the mesh's size or the driver's limit.
struct Tuning {
  unsigned group = 0;         ///< invocations of a work-group of the solving kernel, a power of two up to 1024
  unsigned patch = 0;         ///< constraints of a patch in mode constraint, vertices of a patch in mode node
  unsigned row = 0;           ///< most work-groups in a dispatch's first dimension
  std::size_t storage = 0;    ///< most bytes of a storage buffer
  unsigned threads = 0;       ///< of mode cpu-fast; 0: up to the number of cores, as there is work for
  bool count_guards = false;  ///< GPU kernels count how often each guard triggers (CPU modes always do)
};
/// The tuning in the environment variable TETPBD_TUNE, as in "patch=8,group=128". Throws Error for anything else.
Tuning tuning_from_environment();

struct SolverInput {
  const Model& model;
  const ConstraintSystem& system;
  const Settings& settings;
  Plan plan;
  Tuning tuning;             ///< `row` and `storage` filled in
  bool software = false;     ///< OpenGL runs on the CPU
  bool compliant = false;    ///< a material is (settings.h)
  bool fine_quanta = false;  ///< quantum_fineness() is not empty
  bool rigid = false;        ///< hard bodies move as rigid ones (any_moves_rigidly())
};

/// A row of the table of modes: what the mode is called, what makes it, and what it can do.
struct SolverMode {
  const char* name = "";
  const char* help = "";
  Solver (*create)(const SolverInput&) = nullptr;
  bool compliance = true;             ///< solves constraints with compliance
  bool forces = false;                ///< of what has a material or compliance, in place of corrections
  bool implicit = false;              ///< forces in steps of BDF2, whose velocities are those at a step's end
  bool leapfrog = false;              ///< forces in as many explicit substeps as stay stable
  bool pairs = false;                 ///< contact between bodies
  bool smoothed = false;              ///< has smoothed tets, in place of which others solve linear ones
  bool accelerates = false;           ///< its sweeps can be accelerated
  bool jacobi = false;                ///< corrections are averaged, or masses split
  bool in_place = false;              ///< on the GPU, a constraint moves its vertices before the next one is solved
  bool cpu = false;                   ///< steps on the CPU, where `Sim::host` is the state
  bool all_cores = false;             ///< of the CPU
  bool published = false;             ///< as in the paper: corrections are averaged, and make hard bodies rebound
  bool offered = true;                ///< in --mode and the window, else in bench and compare alone
  int iterations = 1, substeps = 20;  ///< defaults; the least number of substeps where `leapfrog`
  /// Whether iterations and substeps mean the same in both modes.
  bool solves_like(const SolverMode& other) const {
    return forces == other.forces && leapfrog == other.leapfrog && implicit == other.implicit;
  }
};
/// The modes that are offered.
const std::vector<SolverMode>& solver_modes();
/// Searches all modes; nullptr if none has this name.
const SolverMode* find_solver_mode(const std::string& name);
/// The row of the settings' mode. A baseline that compare runs beside modes has a row that can do nothing.
const SolverMode& solver_mode(const Settings& settings);

/// The word SCHEME: which file of shaders/solvers/ says how a vertex moves.
ShaderWords scheme_words(const SolverInput& input);
/// A definition for a shader.
std::string define(const char* name, std::size_t value);
/// Definitions for the shaders that read quantized positions (types.glsl).
std::vector<std::string> quanta_defines(const SolverInput& input);
/// Definitions for the shaders that move vertices (vertex.glsl).
std::vector<std::string> vertex_defines(const SolverInput& input);
/// Words for the shaders, by kind present. INDEX counts the kinds present, KIND_ROW and KIND_COLUMN find the kind in
/// the step block, PAIRS are of words in a record, MATERIAL is 1 where the kind has compliances of its own, and OWN
/// where it has k and damping as well. PROJECT is the file that projects it; the others are as in ConstraintKind.
std::vector<Substitutions> kind_words(const ConstraintSystem& system);
/// The records of a list (layout.glsl: Record2, Record4).
Buffer record_buffer(const ConstraintList& list, const std::string& kind);
/// Throws Error if a buffer is larger than a storage block may be.
void check_storage(const Tuning& tuning, const std::string& label, std::size_t bytes);
/// Gives the solver a buffer, which its kernels know by the name of a block.
void add_buffer(Solver& solver, const Tuning& tuning, const char* block, Buffer buffer);

/// How constraints are cut, as in Tuning.
struct Cut {
  unsigned patch, group;
};
/// The cut, or what `tuning` has in its place. Throws Error if a work-group cannot have that size.
Cut tuned(Cut cut, const Tuning& tuning);

}  // namespace tetpbd
