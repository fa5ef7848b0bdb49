// The second level of mode newton's preconditioner: parts of bodies, each of which moves as a rigid one, with
// weights that fade into its neighbours (smoothed aggregation: Vanek, Mandel and Brezina 1996).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/model/model.h"
#include "sim/parallel.h"

namespace tetpbd {

struct Aggregate {
  glm::dvec3 centre;  ///< of mass at rest
  double reach;       ///< m, unit of its turns
};
/// What a vertex has of an aggregate; weights of a vertex sum up to 1 or, of a fixed one, to 0. In 65535ths,
/// so that the sum is exact in whatever holds them.
struct Share {
  std::uint32_t aggregate = 0, weight = 0;
};
struct Aggregates {
  std::vector<Aggregate> all;
  std::vector<std::array<Share, 4>> of_vertex;  ///< largest first; those of weight 0 are none
  Grouped members;                              ///< by aggregate, vertex * 4 + which of its shares
};
/// About `wanted`, by distance along `neighbours` (so that parts that are near but not joined stay apart), of
/// vertices that move. A part without any gets one of its own while there are fewer than most_aggregates;
/// the others have none.
constexpr std::size_t most_aggregates = 500;
Aggregates make_aggregates(const Model& model, const Grouped& neighbours, std::size_t wanted);

/// Rows of the block matrix that the coarse one is made from: by directed edge, as `neighbours`.
struct BlockRows {
  const Grouped& neighbours;
  const std::vector<double>& inertia;     ///< mass / h^2 by vertex, 0: fixed
  const std::vector<glm::dmat3>& blocks;  ///< by directed edge, without the diagonal, minus their sum
};
/// The inverse of the coarse matrix, row by row, each filled up to a multiple of 4.
std::vector<float> coarse_inverse(const Model& model, const Aggregates& aggregates, const BlockRows& rows);

}  // namespace tetpbd
