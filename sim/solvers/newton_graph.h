// The matrix of mode newton as a graph: its edges, the uses of constraints that these add up, and its blocks at rest.
#pragma once

#include "sim/parallel.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

/// shaders/solvers/newton/layout.glsl as C++.
namespace newton {
using glm::uint;
using glm::vec3;
using glm::vec4;
#include "shaders/solvers/newton/layout.glsl"
static_assert(sizeof(EdgeBlock) == 48 && sizeof(BodyRange) == 36);
static_assert(sizeof(Iteration) == 12 && sizeof(BodyMotion) == 64 && sizeof(MomentumSums) == 16 * MOMENTUM_COLUMNS);
}  // namespace newton

struct NewtonGraph {
  /// An edge's use of a constraint (PACKED_USE).
  struct Use {
    std::uint64_t edge;  ///< first vertex << 32 | second
    std::uint32_t packed;
    auto operator<=>(const Use&) const = default;
  };
  std::vector<Use> uses;                 ///< sorted
  std::vector<std::uint32_t> first_use;  ///< by edge, and the end
  Grouped neighbours;                    ///< by vertex
  std::vector<std::uint32_t> edge_of;    ///< by neighbour: edge * 2, and 1 where the vertex is its second
  std::size_t edges() const { return first_use.size() - 1; }
  std::uint32_t first(std::size_t e) const { return std::uint32_t(uses[first_use[e]].edge >> 32); }
  std::uint32_t second(std::size_t e) const { return std::uint32_t(uses[first_use[e]].edge); }
};
/// Throws Error where a kind has more constraints than a use can name.
NewtonGraph build_newton_graph(const ConstraintSystem& system, std::size_t vertices);

/// Blocks by neighbour, J/m^2. With smoothed tets neighbours of neighbours are among them.
struct BlocksAtRest {
  Grouped neighbours;
  std::vector<glm::dmat3> blocks;
};
/// Of the matrix at rest, for steps of BDF2 of `h` seconds.
BlocksAtRest compute_blocks_at_rest(const SolverInput& input, const NewtonGraph& graph, double h);

}  // namespace tetpbd
