// Solver modes: how one substep's constraints are solved. A mode is a solve_*.cpp and a row of
// solver_modes().
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "sim/constraints.h"
#include "sim/layout.h"
#include "sim/gpu.h"
#include "sim/model.h"
#include "sim/settings.h"

namespace tetpbd {

/// One dispatch. The barrier for its storage writes stands behind it.
struct Pass {
  Program program;
  unsigned groups = 0;
  std::size_t bytes = 0;  ///< read and written by all invocations together; caches may serve part of it
  std::vector<std::pair<int, GLuint>> bindings;  ///< storage binding, buffer; beside those every pass shares
};

/// State on the CPU, in double: what CPU modes step and what tests compare.
struct State {
  std::vector<glm::dvec3> positions;   ///< m
  std::vector<glm::dvec3> velocities;  ///< m/s
};

/// How often each guard of layout.glsl triggered, in its order. A projection counts once where each constraint is evaluated once
/// (constraint and cpu modes), and once a vertex of it in node mode.
using GuardCounts = std::array<std::uint64_t, GUARDS>;
inline constexpr std::array<const char*, GUARDS> guard_names = {"direction",    "hinge", "angle",
                                                               "volume_floor", "collapsed", "limit",
                                                               "not_finite"};

/// Passes or a function, never both.
struct Solver {
  std::vector<Buffer> buffers;
  std::vector<Pass> iteration;   ///< the dispatches of one iteration, in order
  bool double_buffered = false;  ///< an iteration reads one position buffer and writes the other
  std::function<void(State&, const Settings&, const std::vector<double>& inverse_masses)> step_on_cpu;
  std::function<GuardCounts()> guards_on_cpu;
};

struct SolverInput {
  const Model& model;
  const ConstraintSystem& system;
  bool software = false;      ///< the "GPU" is a CPU
  bool count_guards = false;  ///< GPU kernels count into the counters at BIND_GUARDS; CPU modes always count
};

struct SolverMode {
  const char* name;
  const char* help;
  Solver (*create)(const SolverInput&);
};
const std::vector<SolverMode>& solver_modes();

Solver create_constraint_solver(const SolverInput&);  ///< solve_constraint.cpp
Solver create_node_solver(const SolverInput&);        ///< solve_node.cpp
Solver create_cpu_solver(const SolverInput&);         ///< solve_cpu.cpp, float
Solver create_cpu_double_solver(const SolverInput&);  ///< solve_cpu.cpp, double

/// Words for the shaders of the kinds present: KIND, ARITY, INDEX (among those present), BINDING, KIND_ROW
/// and KIND_COLUMN (of the stiffness).
std::vector<Substitutions> kind_words(const ConstraintSystem& system);
/// Record buffers of the kinds present, in the order of kind_words (layout.glsl: Record2, Record4).
std::vector<Buffer> record_buffers(const ConstraintSystem& system);

}  // namespace tetpbd
