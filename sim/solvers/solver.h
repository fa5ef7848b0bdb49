// Solver modes: how one substep's constraints are solved. A mode is a file of this folder and a row in
// solver.cpp; what is the same for several stands here. May use mesh, gl, model, constraints and settings,
// and knows nothing of Sim.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "sim/constraints.h"
#include "sim/gl/gpu.h"
#include "sim/layout.h"
#include "sim/model.h"
#include "sim/settings.h"
#include "sim/solvers/patches.h"

namespace tetpbd {

/// A kernel, and how many work-groups of it a dispatch has.
struct Pass {
  Program program;
  std::size_t work_groups = 0;
  std::size_t bytes = 0;  ///< read and written by all invocations together; caches may serve part of it
  GLuint records = 0;     ///< buffer to bind to BIND_RECORDS before it (mode paper)
  /// Where the program has its dispatch parameters (-1: nowhere), and their values; asked for and set in
  /// step.cpp.
  std::array<GLint, 2> locations{};
  std::array<unsigned, 2> parameters{~0u, ~0u};
  Timer timer{};  ///< of its dispatches, while they are timed
};

/// How often each guard of layout.glsl triggered, in its order. A projection counts once where each
/// constraint is evaluated once (constraint and cpu modes), and once a vertex of it in node mode.
using GuardCounts = std::array<std::uint64_t, GUARDS>;
inline constexpr std::array<const char*, GUARDS> guard_names = {
    "direction", "hinge", "angle", "volume_floor", "collapsed", "limit", "not_finite"};

/// A pass in a substep, and the phases (layout.glsl PHASE_) it goes through.
struct Dispatch {
  std::size_t pass;
  unsigned phases;
};

struct SolverInput;
using MakeWords = std::function<std::vector<glm::vec4>()>;

/// Passes or a function, never both.
struct Solver {
  std::vector<Buffer> buffers;
  std::vector<std::pair<int, GLuint>> bindings;  ///< storage binding, buffer; beside those every mode shares
  std::vector<Pass> iteration;  ///< the passes of one iteration, in order; the last one moves the vertices
  bool double_buffered =
      false;  ///< an iteration reads one buffer of quantized positions and writes the other
  /// The dispatches of a substep of so many iterations, where they are not those of Jacobi; and the pass in
  /// place of predict.comp.
  std::vector<Dispatch> (*schedule)(int iterations) = nullptr;
  Pass begin;
  /// What a step hands on to the next beside what every mode has: of these `buffers`, first byte and bytes.
  std::vector<std::array<std::size_t, 3>> handed_on{};
  /// What is made for certain forces and a certain length of a substep (mode newton's second level): a job
  /// for others, to run in any thread while the model lives, and the number of the buffer that is to hold it.
  std::function<MakeWords(const SolverInput&)> renewed{};
  std::size_t renewable = 0;
  /// With it: takes over other numbers of the same constraints.
  std::function<void(const Solver&, const ConstraintSystem&)> take_numbers{};
  bool unfused = false;  ///< prediction and velocities in dispatches of their own
  /// `time`: at the step's start, s.
  std::function<GuardCounts(State&, const Settings&, const std::vector<double>& inverse_masses, double time)>
      step_on_cpu;
};

/// The dispatches of a substep in order (method.md, "A step"): predict, solve x iterations, finish.
/// Prediction and velocities ride on the first and last iteration, but where the solver has them apart.
std::vector<Dispatch> substep_dispatches(const Solver& solver, int iterations);

/// How kernels are cut into invocations; 0: by the mesh's size or the driver's limit. For measurements and
/// tests.
struct Tuning {
  unsigned group = 0;       ///< invocations of a work-group of the solving kernel, a power of two up to 1024
  unsigned patch = 0;       ///< constraints of a patch in mode constraint, vertices of one in mode node
  unsigned row = 0;         ///< most work-groups in a dispatch's first dimension
  std::size_t storage = 0;  ///< most bytes of a storage buffer
  unsigned lanes = 0;       ///< invocations that look for what a vertex touches, a power of two up to 8
  unsigned threads = 0;     ///< of mode cpu-fast; 0: as many as the machine has cores and work is for
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
  bool leapfrog = false;   ///< SolverMode
};

/// A row of the table: what the mode is called, what makes it, and what it can do.
struct SolverMode {
  const char* name;
  const char* help;
  Solver (*create)(const SolverInput&);
  bool compliance = true;             ///< and compliance
  bool implicit = false;              ///< forces, in implicit steps
  bool leapfrog = false;              ///< forces in place of corrections: substeps are as many as stay stable
  bool pairs = false;                 ///< and contact between bodies
  int iterations = 1, substeps = 20;  ///< where nothing is asked for; of leapfrog the least, 1
  bool offered = true;                ///< in --mode and the window; else in bench and compare alone
};
/// Whether iterations and substeps mean the same in both: corrections, leapfrog or implicit steps.
inline bool solved_alike(const SolverMode& a, const SolverMode& b) {
  return a.leapfrog == b.leapfrog && a.implicit == b.implicit;
}
/// Those that are offered.
const std::vector<SolverMode>& solver_modes();
/// Of all modes; nullptr if there is none.
const SolverMode* find_solver_mode(const std::string& name);

/// Whether its mode does.
bool leaps(const Settings& settings);
bool is_implicit(const Settings& settings);

/// Definitions for the shaders that move vertices (vertex.glsl).
std::vector<std::string> vertex_defines(const SolverInput& input);
/// Words for the shaders of the kinds present: KIND, ARITY, INDEX (among those present), KIND_ROW and
/// KIND_COLUMN (of the stiffness), PAIRS (of a record), MATERIAL (1: it has compliances of its own), PROJECT
/// (the file that projects it), RATE (1: only its change counts), VALUES (at rest).
std::vector<Substitutions> kind_words(const ConstraintSystem& system);
/// The records of one list (layout.glsl: Record2, Record4).
Buffer record_buffer(const ConstraintList& list, const std::string& kind);
/// Throws Error if a buffer is larger than a storage block may be.
void check_storage(const Tuning& tuning, const std::string& label, std::size_t bytes);
/// A buffer of the solver, bound to `binding` in every step.
void add_buffer(Solver& solver, const Tuning& tuning, int binding, Buffer buffer);

/// How constraints are cut: `patch` as in Tuning, invocations of a work-group.
struct Cut {
  unsigned patch, group;
};
/// With what `tuning` overrides; throws Error if a work-group cannot have that size.
Cut tuned(Cut cut, const Tuning& tuning);
/// Gives a solver a pass of `shader`, a work-group per patch, and the patches' buffers (patch.glsl).
void add_patches(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                 unsigned group);
/// Gives a solver its sums of corrections, at zero, and its last pass, which averages them and moves the
/// vertices (average.comp).
void add_average(Solver& solver, const SolverInput& input, unsigned group, bool float_sums);

}  // namespace tetpbd
