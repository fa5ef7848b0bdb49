// The coarse level of mode newton's preconditioner: aggregates, parts of bodies each of which moves as a rigid one,
// with weights that fade into its neighbours (smoothed aggregation: Vanek, Mandel and Brezina 1996).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/model/model.h"
#include "sim/parallel.h"

namespace tetpbd {

struct Aggregate {
  glm::dvec3 centre;  ///< of mass at rest
  double reach;       ///< m, unit of its rotations
};
/// How far a vertex moves with an aggregate, in 65535ths. Whole numbers add up to exactly 1 for a vertex, and to 0 for
/// a fixed one.
struct Share {
  std::uint32_t aggregate = 0, weight = 0;
};
struct Aggregates {
  std::vector<Aggregate> all;                   ///< body by body
  std::vector<std::uint32_t> first;             ///< by body, and the end
  std::vector<std::array<Share, 4>> of_vertex;  ///< largest first; a weight of 0: no share
  Grouped members;                              ///< by aggregate: vertex * 4 + which of its shares
  std::size_t of_body(std::size_t body) const { return first[body + 1] - first[body]; }
};
constexpr std::size_t most_aggregates = 500;
/// About as many aggregates as wanted of each body's vertices that are not fixed, by distance along `neighbours`, so
/// that parts which are near but not joined stay apart. Each part gets at least one, up to most_aggregates of a body.
Aggregates make_aggregates(const Model& model, const Grouped& neighbours, const std::vector<std::size_t>& wanted);

/// The block matrix that the coarse one is made from, row by row.
struct BlockRows {
  const Grouped& neighbours;
  const std::vector<double>& inertia;     ///< mass / h^2 by vertex, 0: fixed
  const std::vector<glm::dmat3>& blocks;  ///< as `neighbours`; a diagonal block is inertia less the row's sum of them
};
/// The inverse of a body's coarse matrix, row by row, each filled up with zeros to a multiple of 4; where `pivot` is
/// the body's centre of mass at rest, without what its rigid motions add, which a solver then knows better, for it
/// knows what the body touches.
std::vector<float> coarse_inverse(const Model& model, std::size_t body, const Aggregates& aggregates,
                                  const BlockRows& rows, const glm::dvec3* pivot);

}  // namespace tetpbd
