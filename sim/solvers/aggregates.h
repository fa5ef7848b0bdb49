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
  std::vector<Aggregate> all;
  std::vector<std::array<Share, 4>> of_vertex;  ///< largest first; a weight of 0: no share
  Grouped members;                              ///< by aggregate: vertex * 4 + which of its shares
};
constexpr std::size_t most_aggregates = 500;
/// About `wanted` aggregates of the vertices that are not fixed, by distance along `neighbours`, so that parts which
/// are near but not joined stay apart. Each part that is joined to no other gets at least one, up to most_aggregates.
Aggregates make_aggregates(const Model& model, const Grouped& neighbours, std::size_t wanted);

/// The block matrix that the coarse one is made from, row by row.
struct BlockRows {
  const Grouped& neighbours;
  const std::vector<double>& inertia;     ///< mass / h^2 by vertex, 0: fixed
  const std::vector<glm::dmat3>& blocks;  ///< as `neighbours`; a diagonal block is inertia less the row's sum of them
};
/// A body whose aggregates move together as a rigid one, about its centre of mass at rest.
struct RigidPart {
  std::vector<std::uint32_t> aggregates;
  glm::dvec3 centre;
};
/// The inverse of the coarse matrix, row by row, each filled up with zeros to a multiple of 4; without what rigid
/// motions of `rigid` add to it, which a solver then knows better, for it knows what a body touches.
std::vector<float> coarse_inverse(const Model& model, const Aggregates& aggregates, const BlockRows& rows,
                                  const std::vector<RigidPart>& rigid);

}  // namespace tetpbd
