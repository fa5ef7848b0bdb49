// Plastic flow (method.md, "Plastic flow"): a tet that is deformed beyond its yield strain keeps a part of that as its
// new shape at rest, once a step.
#pragma once

#include <vector>

#include "sim/gl/gpu.h"
#include "sim/gl/layout.h"
#include "sim/gl/pass.h"
#include "sim/model/constraints.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Sim;
struct Solver;
struct SolverInput;

/// What a Sim has of all tets where any body yields. In GPU modes `records` are the state, in CPU modes a copy of
/// State::rest_metrics that measuring reads.
struct Yielding {
  std::vector<layout::YieldRecord> at_start;
  Buffer records;
  Buffer copies;        ///< words of the solver's buffer where the metrics stand as well
  Pass pass;            ///< in GPU modes
  bool copied = false;  ///< the solver has them as they are
  explicit operator bool() const { return !at_start.empty(); }
};
Yielding make_yielding(const SolverInput& input, const Solver& solver);

/// By constraint c of `count` its tet, or of lanes that repeat another's that one's; vertices(c) are those of a tet.
std::vector<std::uint32_t> find_tets(const TetMesh& mesh, std::size_t count, const auto& vertices);
/// Puts metrics in place of a list's rest values.
void put_rest_metrics(ConstraintList& tets, const TetMesh& mesh, const std::vector<double>& metrics);

/// At the end of a step.
void flow(Sim& sim);
/// Before a step, where the solver may have other metrics than `records`.
void copy_rest_metrics(Sim& sim);
/// Takes over a state's metrics; none: those at the start.
void write_rest_metrics(Sim& sim, const std::vector<double>& metrics);
/// State::rest_metrics of records in a buffer.
std::vector<double> rest_metrics_in(const Buffer& from, std::size_t at, std::size_t tets);

std::vector<std::uint32_t> find_tets(const TetMesh& mesh, std::size_t count, const auto& vertices) {
  std::vector<std::uint32_t> order(mesh.tets.size()), result(count);
  for (std::uint32_t t = 0; t < order.size(); ++t) order[t] = t;
  const auto tet = [&](std::uint32_t t) { return mesh.tets[t]; };
  std::ranges::sort(order, {}, tet);
  for (std::size_t c = 0; c < count; ++c) {
    Tet own;
    std::ranges::copy(vertices(c), own.begin());
    result[c] = *std::ranges::lower_bound(order, own, {}, tet);
  }
  return result;
}

}  // namespace tetpbd
