#include "sim/mesh/topology.h"

#include <algorithm>
#include <tuple>

namespace tetpbd {

SurfaceTopology surface_topology(const std::vector<Triangle>& triangles, std::size_t vertex_count) {
  SurfaceTopology topology;
  auto& uses = topology.uses;
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), t, k, a < b});
    }
  std::ranges::sort(uses, {}, [](const EdgeUse& use) { return std::tuple(use.low, use.high, use.triangle); });
  for (std::uint32_t i = 0; i < uses.size(); ++i)
    if (i == 0 || uses[i].low != uses[i - 1].low || uses[i].high != uses[i - 1].high)
      topology.edges.push_back(i);
  topology.edges.push_back(std::uint32_t(uses.size()));

  // Each triangle is in two sets, as it is (2 t) and turned (2 t + 1): what is in one agrees.
  DisjointSets ways(triangles.size() * 2), corners(triangles.size() * 3);
  const auto corner = [&](const EdgeUse& use, std::uint32_t vertex) {
    const bool first = triangles[use.triangle][use.side] == vertex;
    return use.triangle * 3 + (first ? use.side : (use.side + 1) % 3);
  };
  for (std::uint32_t e = 0; e < topology.edge_count(); ++e) {
    if (topology.uses_of(e) != 2) continue;
    const EdgeUse &a = uses[topology.edges[e]], &b = uses[topology.edges[e] + 1];
    const std::uint32_t i = 2 * a.triangle, agreeing = 2 * b.triangle + (a.forward == b.forward);
    if (ways.root(i) == ways.root(agreeing ^ 1)) {
      topology.one_sided.push_back(e);
    } else {
      ways.join(i, agreeing);
      ways.join(i ^ 1, agreeing ^ 1);
    }
    corners.join(corner(a, a.low), corner(b, a.low));
    corners.join(corner(a, a.high), corner(b, a.high));
  }
  std::vector<std::uint32_t> number(triangles.size() * 2, ~0u);  // of a set's patch, by its root
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const std::uint32_t as_is = ways.root(2 * t), turned = ways.root(2 * t + 1);
    if (number[as_is] == ~0u) number[as_is] = number[turned] = std::uint32_t(topology.patches++);
    topology.patch.push_back(number[as_is]);
    topology.turned.push_back(as_is > turned);
  }
  topology.fans.assign(vertex_count, 0);
  for (std::uint32_t c = 0; c < triangles.size() * 3; ++c)
    if (corners.root(c) == c) ++topology.fans[triangles[c / 3][c % 3]];
  for (const std::uint32_t fans : topology.fans) topology.vertices += fans > 0;
  return topology;
}

}  // namespace tetpbd
