#include "sim/contact/pair_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "sim/model/hilbert.h"
#include "sim/model/model.h"

namespace tetpbd {

using namespace pair_layout;

SurfaceLeaves cut_leaves(const Model& model, const Surfaces& surfaces) {
  constexpr std::size_t most = 64;  // triangles
  const TetMesh& rest = model.rest;
  const Bounds box = bounds(rest.positions);
  std::vector<std::tuple<std::uint32_t, std::uint64_t, std::uint32_t>> keys;  // body, place, triangle
  for (std::uint32_t t = 0; t < rest.surface.size(); ++t) {
    const auto& [i, j, k] = rest.surface[t];
    const glm::dvec3 centre = (rest.positions[i] + rest.positions[j] + rest.positions[k]) / 3.0;
    keys.emplace_back(surfaces.triangle_bodies[t], hilbert_key(centre, box), t);
  }
  std::ranges::sort(keys);
  SurfaceLeaves result;
  std::vector<bool> has_vertex(rest.positions.size()), has_edge(surfaces.edges.size());
  for (const auto& [body, place, t] : keys) {
    if (result.leaves.empty() || result.leaves.back().body != body ||
        result.leaves.back().triangles[1] - result.leaves.back().triangles[0] == most) {
      const auto triangle = std::uint32_t(result.triangles.size()), vertex = std::uint32_t(result.vertices.size()),
                 edge = std::uint32_t(result.edges.size());
      result.leaves.push_back({body, {triangle, triangle}, {vertex, vertex}, {edge, edge}, 0});
    }
    SurfaceLeaf& leaf = result.leaves.back();
    result.triangles.push_back(t), ++leaf.triangles[1];
    for (const std::uint32_t v : rest.surface[t]) {
      leaf.offset = std::max(leaf.offset, float(surfaces.offsets[v]));
      if (!has_vertex[v]) has_vertex[v] = true, result.vertices.push_back(v), ++leaf.vertices[1];
    }
    for (const std::uint32_t e : surfaces.triangle_edges[t])
      if (!has_edge[e]) has_edge[e] = true, result.edges.push_back(e), ++leaf.edges[1];
  }
  return result;
}

std::vector<std::string> pair_defines(const PairSizes& sizes) {
  return {fmt::format("TRIANGLES {}u", sizes.triangles),
          fmt::format("EDGES {}u", sizes.edges),
          fmt::format("SURFACE_VERTICES {}u", sizes.surface_vertices),
          fmt::format("LEAVES {}u", sizes.leaves),
          fmt::format("BRANCHES {}u", sizes.branches()),
          fmt::format("FIRST_BALL_OF_TRIANGLES {}u", sizes.surface_vertices),
          fmt::format("FIRST_BALL_OF_EDGES {}u", sizes.surface_vertices + sizes.triangles),
          fmt::format("VERTICES {}u", sizes.vertices),
          fmt::format("PLACES {}u", sizes.places)};
}

PairRanges lay_out_pairs(const PairSizes& sizes) {
  PairRanges to;
  to.triangles = to.mesh.add<glm::uvec4>("triangles", sizes.triangles);
  to.edges = to.mesh.add<glm::uvec4>("edges", sizes.edges);
  to.places = to.mesh.add<glm::vec4>("places", sizes.places);
  to.triangle_edges = to.mesh.add<std::uint32_t>("triangle_edges", 3 * sizes.triangles);
  to.own_triangle = to.mesh.add<std::uint32_t>("own_triangle", sizes.vertices);
  to.offsets = to.mesh.add<float>("offsets", sizes.vertices);
  to.first_neighbour = to.mesh.add<std::uint32_t>("first_neighbour", sizes.vertices + 1);
  to.neighbours = to.mesh.add<std::uint32_t>("neighbours", 2 * sizes.edges);
  to.leaf_triangles = to.mesh.add<std::uint32_t>("leaf_triangles", sizes.triangles);
  to.leaf_vertices = to.mesh.add<std::uint32_t>("leaf_vertices", sizes.surface_vertices);
  to.leaf_edges = to.mesh.add<std::uint32_t>("leaf_edges", sizes.edges);
  to.leaves = to.mesh.add<SurfaceLeaf>("leaves", sizes.leaves);
  to.leaf_lows = to.lists.add<glm::vec4>("leaf_lows", sizes.leaves);
  to.leaf_highs = to.lists.add<glm::vec4>("leaf_highs", sizes.leaves);
  to.lists.add<glm::vec4>("leaf_velocities", sizes.leaves);
  to.totals = to.lists.add<ContactTotals>("totals");
  to.counts = to.lists.add<PairCounts>("counts");
  to.branches = to.lists.add<SurfaceBranch>("branches", sizes.branches());
  return to;
}

std::vector<std::byte> fill_pair_mesh(const Model& model, const Surfaces& surfaces, const SurfaceLeaves& leaves,
                                      const PairRanges& ranges) {
  std::vector<glm::uvec4> triangles, edges;
  std::vector<std::uint32_t> triangle_edges;
  std::vector<glm::vec4> places;
  for (const auto* all : {&model.positions, &model.rest.positions})
    for (const glm::dvec3& x : *all)
      if (places.size() < ranges.places.count) places.emplace_back(glm::vec3(x), 0);
  for (const auto& [i, j, k] : model.rest.surface) triangles.emplace_back(i, j, k, 0);
  for (const auto& [ends, beside, body] : surfaces.edges) edges.emplace_back(ends[0], ends[1], beside[0], beside[1]);
  for (const auto& three : surfaces.triangle_edges)
    triangle_edges.insert(triangle_edges.end(), three.begin(), three.end());
  std::vector<std::byte> contents(ranges.mesh.bytes);
  put(contents, ranges.triangles, triangles);
  put(contents, ranges.edges, edges);
  put(contents, ranges.places, places);
  put(contents, ranges.triangle_edges, triangle_edges);
  put(contents, ranges.own_triangle, surfaces.own_triangle);
  put(contents, ranges.offsets, to_floats(surfaces.offsets));
  put(contents, ranges.first_neighbour, surfaces.first_neighbour);
  put(contents, ranges.neighbours, surfaces.neighbours);
  put(contents, ranges.leaf_triangles, leaves.triangles);
  put(contents, ranges.leaf_vertices, leaves.vertices);
  put(contents, ranges.leaf_edges, leaves.edges);
  put(contents, ranges.leaves, leaves.leaves);
  return contents;
}

std::vector<std::byte> make_empty_lists(const PairRanges& ranges) {
  ContactTotals totals{};
  totals.nearest = std::bit_cast<std::uint32_t>(1e30f);
  PairCounts counts{};
  counts.leaf_pair_groups = counts.candidate_groups = counts.pair_groups = {0, 1, 1};
  const std::uint32_t most = 0xffffffff;
  const SurfaceBranch branch{{most, most, most}, {0, 0, 0}, 0, 0};
  std::vector<std::byte> contents(ranges.lists.bytes);
  put(contents, ranges.totals, std::vector{totals});
  put(contents, ranges.counts, std::vector{counts});
  put(contents, ranges.branches, std::vector(ranges.branches.count, branch));
  return contents;
}

}  // namespace tetpbd
