#include "sim/solvers/newton_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "sim/error.h"
#include "sim/reference/smoothed.h"

namespace tetpbd {

NewtonGraph build_newton_graph(const ConstraintSystem& system, std::size_t vertices) {
  NewtonGraph graph;
  std::size_t total = 0;
  for (const ConstraintList& list : system.lists)
    total += list.count() * std::size_t(list.arity * (list.arity - 1) / 2);
  graph.uses.resize(total);
  std::size_t begin = 0;
  std::uint32_t kind = 0;  // among those present
  for (std::size_t k = 0; k < kind_count; ++k) {
    if (!system.present[k]) continue;
    const ConstraintList& list = system.lists[k];
    const std::size_t arity = std::size_t(list.arity), pairs = arity * (arity - 1) / 2;
    if (list.count() >= MOST_CONSTRAINTS)
      throw Error("too many constraints for mode newton",
                  fmt::format("{} of {}", list.count(), constraint_kinds[k].noun), "use a smaller mesh or another mode",
                  1);
    parallel_for(list.count(), [&](std::size_t c) {
      NewtonGraph::Use* use = &graph.uses[begin + pairs * c];
      const auto ends = list.ends(c);
      for (std::uint32_t i = 0; i < arity; ++i)
        for (std::uint32_t j = i + 1; j < arity; ++j) {
          const bool turned = ends[i] > ends[j];
          const std::uint32_t low = turned ? j : i, high = turned ? i : j;
          *use++ = {std::uint64_t(ends[low]) << 32 | ends[high], PACKED_USE(std::uint32_t(c), kind, low, high)};
        }
    });
    begin += pairs * list.count(), ++kind;
  }
  parallel_sort(std::span(graph.uses));
  for (std::size_t u = 0; u < graph.uses.size(); ++u)
    if (u == 0 || graph.uses[u].edge != graph.uses[u - 1].edge) graph.first_use.push_back(std::uint32_t(u));
  graph.first_use.push_back(std::uint32_t(graph.uses.size()));
  const auto at_vertex = group_by_key(graph.edges(), vertices, [&](std::size_t e, auto&& emit) {
    emit(graph.first(e), std::uint32_t(2 * e));
    emit(graph.second(e), std::uint32_t(2 * e + 1));
  });
  graph.edge_of = at_vertex.values;
  graph.neighbours = at_vertex;
  for (std::uint32_t& v : graph.neighbours.values) v = v % 2 ? graph.first(v / 2) : graph.second(v / 2);
  return graph;
}

namespace {

// A constraint's block of the matrix at rest, as in element.glsl.
template <class Kind>
glm::dmat3 compute_block_at_rest(const SolverInput& input, const ConstraintList& list, std::size_t c, int i, int j,
                                 double h) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  const Settings& settings = input.settings;
  std::array<glm::dvec3, arity> x;
  for (std::size_t k = 0; k < arity; ++k) x[k] = input.model.rest.positions[list.ends(c)[k]];
  const double* rest = &list.rest[c * std::size_t(Kind::row.values)];
  if constexpr (Kind::row.averaged) {
    return Formulas<double>{}.smoothed_part(x.data(), rest, &list.compliance[2 * c], 1, i, j).block;
  } else if constexpr (Kind::row.components == 2) {
    return Formulas<double>{}.neo_hookean_part(x.data(), rest, &list.compliance[2 * c], i, j).block;
  } else {
    const double a = list.compliance.empty() ? settings.compliance[index_of<Kind>] : list.compliance[c];
    const double held =
        (Kind::row.rate ? 0 : 1) + (Kind::row.rate ? 1 : list.damping_at(c, settings.constraint_damping)) / h;
    const auto value = Kind::template evaluate<double>(x.data(), rest_values<Kind>(rest));
    return held / a * glm::outerProduct(value.gradient[i], value.gradient[j]);
  }
}

// Adds what averages of smoothed tets make of each row.
BlocksAtRest add_averages(const BlocksAtRest& tets, const Averages& averages, const Points& rest) {
  const std::size_t count = rest.size();
  std::vector<AverageHessian> hessians(count);
  parallel_for(count, 256, [&](std::size_t v) { hessians[v] = average_hessian(averages, v, rest, true); });
  std::vector<std::map<std::uint32_t, glm::dmat3>> rows(count);
  parallel_for(count, 64, [&](std::size_t v) {
    for (std::uint32_t n = tets.neighbours.first[v]; n < tets.neighbours.first[v + 1]; ++n)
      rows[v].emplace(tets.neighbours.values[n], tets.blocks[n]);
    for (const std::uint32_t around : hessians[v].ids) {
      const AverageHessian& average = hessians[around];
      const auto own = std::size_t(std::ranges::find(average.ids, v) - average.ids.begin());
      for (std::size_t j = 0; j < average.slopes.size(); ++j)
        if (average.ids[j] != v) rows[v].try_emplace(average.ids[j], 0.0).first->second += average.block(own, j);
    }
  });
  BlocksAtRest result;
  result.neighbours.first = {0};
  for (const auto& row : rows) {
    for (const auto& [neighbour, block] : row)
      result.neighbours.values.push_back(neighbour), result.blocks.push_back(block);
    result.neighbours.first.push_back(std::uint32_t(result.blocks.size()));
  }
  return result;
}

}  // namespace

BlocksAtRest compute_blocks_at_rest(const SolverInput& input, const NewtonGraph& graph, double h) {
  std::vector<glm::dmat3> of_edge(graph.edges(), glm::dmat3(0)), blocks(graph.edge_of.size());
  parallel_for(
      of_edge.size(),
      [&](std::size_t e) {
        for (std::uint32_t u = graph.first_use[e]; u < graph.first_use[e + 1]; ++u) {
          const std::uint32_t use = graph.uses[u].packed;
          std::uint32_t kind = USE_KIND(use);
          for_each_kind([&](auto row, int k) {
            if (input.system.present[std::size_t(k)] && kind-- == 0)
              of_edge[e] += compute_block_at_rest<decltype(row)>(input, input.system.lists[std::size_t(k)],
                                                                 USE_CONSTRAINT(use), USE_I(use), USE_J(use), h);
          });
        }
      },
      1024);
  parallel_for(blocks.size(), [&](std::size_t n) {
    const glm::dmat3& block = of_edge[graph.edge_of[n] / 2];
    blocks[n] = graph.edge_of[n] % 2 ? glm::transpose(block) : block;
  });
  BlocksAtRest result{graph.neighbours, std::move(blocks)};
  const Averages& averages = input.system.averages;
  return !has_averages(input.system) ? result : add_averages(result, averages, input.model.rest.positions);
}

}  // namespace tetpbd
