// Solver modes: how one substep's constraints are solved. A mode is a solve_*.cpp and a row of
// solver_modes().
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/constraints.h"
#include "sim/gl/gpu.h"
#include "sim/solvers/handles.h"
#include "sim/layout.h"
#include "sim/model.h"
#include "sim/solvers/patches.h"
#include "sim/settings.h"

namespace tetpbd {

/// One dispatch. The barrier for its storage writes stands behind it.
struct Pass {
  Program program;
  std::size_t groups = 0;
  std::size_t bytes = 0;  ///< read and written by all invocations together; caches may serve part of it
  glm::uvec2 turn{~0u};   ///< the uniform `turn` (places.glsl) as it was last set
};

/// State on the CPU, in double: what CPU modes step and what tests compare.
struct State {
  std::vector<glm::dvec3> positions;   ///< m
  std::vector<glm::dvec3> velocities;  ///< m/s
};

/// How often each guard of layout.glsl triggered, in its order. A projection counts once where each
/// constraint is evaluated once (constraint and cpu modes), and once a vertex of it in node mode.
using GuardCounts = std::array<std::uint64_t, GUARDS>;
inline constexpr std::array<const char*, GUARDS> guard_names = {
    "direction", "hinge", "angle", "volume_floor", "collapsed", "limit", "not_finite"};

/// Passes or a function, never both.
struct Solver {
  std::vector<Buffer> buffers;
  std::vector<std::pair<int, GLuint>> bindings;  ///< storage binding, buffer; beside those every mode shares
  std::vector<Pass>
      iteration;  ///< the dispatches of one iteration, in order; the last one moves the vertices
  bool double_buffered = false;  ///< an iteration reads one buffer of places and writes the other
  int groups = 1;   ///< the last dispatch runs once for each group of constraints, swapping sides every time
  Handles handles;  ///< none but where dispatches keep sums for them, in three sets by turns
  bool compliant = false, damped = false;  ///< what it was made for (constraints.h)
  bool separate = false;                   ///< prediction and velocities in dispatches of their own
  std::function<void(State&, const Settings&, const std::vector<double>& inverse_masses)> step_on_cpu;
  std::function<GuardCounts()> guards_on_cpu;
};

/// How kernels are cut into invocations; 0: by the mesh's size or the driver's limit. For measurements and
/// tests.
struct Tuning {
  unsigned group = 0;  ///< invocations of a work-group of the solving kernel, a power of two up to 1024
  unsigned patch =
      0;             ///< constraints of a patch in mode constraint, vertices of one in modes node and groups
  unsigned row = 0;  ///< most work-groups in a dispatch's first dimension
  std::size_t storage = 0;    ///< most bytes of a storage buffer
  unsigned threads = 0;       ///< of mode cpu-fast; 0: as many as the machine has cores and work is for
  bool count_guards = false;  ///< GPU kernels count how often each guard triggers (CPU modes always do)
};
/// From the variable TETPBD_TUNE, as in "patch=8,group=128"; throws Error for anything else.
Tuning tuning_from_environment();

struct SolverInput {
  const Model& model;
  const ConstraintSystem& system;
  bool software = false;                   ///< the "GPU" is a CPU
  Tuning tuning;                           ///< `row` and `storage` filled in
  int groups = 1;                          ///< of mode groups
  bool compliant = false, damped = false;  ///< constraints.h
  bool handles = false;                    ///< rigid handles are asked for
};

struct SolverMode {
  const char* name;
  const char* help;
  Solver (*create)(const SolverInput&);
};
const std::vector<SolverMode>& solver_modes();
/// Also finds what is not offered but for `bench`: "paper". nullptr if there is none.
const SolverMode* find_solver_mode(const std::string& name);

Solver create_constraint_solver(const SolverInput&);  ///< solve_constraint.cpp
Solver create_node_solver(const SolverInput&);        ///< solve_node.cpp
Solver create_groups_solver(const SolverInput&);      ///< solve_node.cpp
Solver create_cpu_solver(const SolverInput&);         ///< solve_cpu.cpp, float
Solver create_cpu_double_solver(const SolverInput&);  ///< solve_cpu.cpp, double
Solver create_cpu_fast_solver(const SolverInput&);    ///< solve_cpu_fast.cpp
Solver create_paper_solver(const SolverInput&);       ///< solve_paper.cpp

/// Words for the shaders of the kinds present: KIND, ARITY, INDEX (among those present), BINDING (of its
/// records), KIND_ROW and KIND_COLUMN (of the stiffness).
std::vector<Substitutions> kind_words(const ConstraintSystem& system);
/// The records of one list (layout.glsl: Record2, Record4).
Buffer record_buffer(const ConstraintList& list, const std::string& kind);
/// Record buffers of the kinds present, in the order of kind_words.
std::vector<Buffer> record_buffers(const ConstraintSystem& system);
/// Throws Error if a buffer is larger than a storage block may be.
void check_storage(const Tuning& tuning, const std::string& label, std::size_t bytes);
template <class T>
Buffer storage_buffer(const Tuning& tuning, const std::string& label, const std::vector<T>& data) {
  check_storage(tuning, label, data.size() * sizeof(T));
  return Buffer(label, data);
}

/// How constraints are cut: `patch` as in Tuning, invocations of a work-group.
struct Cut {
  unsigned patch, group;
};
/// With what `tuning` overrides; throws Error if a work-group cannot have that size.
Cut tuned(Cut cut, const Tuning& tuning);
/// Words defined in kernels for compliance and constraint damping; none without.
std::vector<std::string> compliance_defines(bool compliant, bool damped);
/// Gives a solver a dispatch of `shader`, a work-group a patch, and the patches' buffers (patch.glsl); with
/// `handles`, theirs (handles.glsl).
void add_patches(Solver& solver, const SolverInput& input, const Patches& patches, const char* shader,
                 unsigned group, bool grouped, Handles* handles = nullptr);
/// Gives a solver its sums of corrections, at zero, and its last dispatch, which averages them and moves the
/// vertices (average.comp).
void add_average(Solver& solver, const SolverInput& input, unsigned group, bool float_sums);

}  // namespace tetpbd
