#include "sim/contact/pair_layout.h"

#include <fmt/format.h>

#include "sim/contact/pairs.h"

namespace tetpbd {

using namespace pair_layout;

std::vector<std::string> pair_defines(const PairSizes& sizes) {
  return {fmt::format("BODY_COUNT {}", sizes.bodies), fmt::format("TRIANGLES {}u", sizes.triangles),
          fmt::format("EDGES {}u", sizes.edges),      fmt::format("SURFACE_VERTICES {}u", sizes.vertices),
          fmt::format("LEAVES {}u", sizes.leaves),    fmt::format("SLICES {}u", sizes.slices),
          fmt::format("TETS {}u", sizes.tets),        fmt::format("LANES {}u", sizes.lanes),
          fmt::format("GROUP_SIZE {}u", sizes.group)};
}

PairRanges lay_out_pairs(const PairSizes& sizes) {
  PairRanges to;
  to.triangles = to.mesh.add<glm::uvec4>("triangles", sizes.triangles);
  to.edge_vertices = to.mesh.add<glm::uvec4>("edge_vertices", sizes.edges);
  to.edge_bodies = to.mesh.add<std::uint32_t>("edge_bodies", sizes.edges);
  to.surface_vertices = to.mesh.add<glm::uvec2>("surface_vertices", sizes.vertices);
  to.first_around = to.mesh.add<std::uint32_t>("first_around", sizes.vertices + 1);
  to.around = to.mesh.add<glm::uvec2>("around", 3 * sizes.triangles);
  to.leaves = to.mesh.add<SurfaceLeaf>("leaves", sizes.leaves);
  to.bodies = to.mesh.add<SurfaceBody>("bodies", sizes.bodies + 1);
  to.slices = to.mesh.add<SurfaceSlice>("slices", sizes.slices);
  to.behind = to.mesh.add<std::uint32_t>("behind", sizes.triangles);
  to.tet_vertices = to.mesh.add<glm::uvec4>("tet_vertices", sizes.tets);
  to.tet_beyond = to.mesh.add<glm::uvec4>("tet_beyond", sizes.tets);

  const std::size_t per_group = sizes.group / sizes.lanes, fills = sizes.leaves * per_group;
  to.totals = to.lists.add<ContactTotals>("totals");
  to.counts = to.lists.add<CandidateCounts>("counts");
  to.boxes = to.lists.add<BodyBox>("boxes", sizes.bodies);
  to.lists.add<std::uint32_t>("held_by", sizes.items());
  to.depths = to.lists.add<float>("depths", sizes.items());
  to.lists.add<std::uint32_t>("near_vertices", sizes.vertices + fills);
  to.lists.add<std::uint32_t>("near_edges", sizes.edges + fills);
  to.lists.add<std::uint32_t>("leaf_of_group", sizes.vertices / per_group + sizes.leaves);
  to.lists.add<std::uint32_t>("leaf_of_edge_group", sizes.edges / per_group + sizes.leaves);
  to.lists.add<LeafBox>("leaf_boxes", sizes.leaves);
  to.lists.add<NearLeaves>("near_leaves", sizes.leaves);
  to.records = to.lists.add<ContactRecord>("records", sizes.items());

  to.sharing = to.sums.add<std::int32_t>("sharing", 2 * sizes.all_vertices);
  to.sums.add<ContactSums>("contact_sums", sizes.all_vertices);
  return to;
}

std::vector<SurfaceSlice> cut_slices(const PairMesh& mesh) {
  constexpr std::uint32_t most = 1024;
  std::vector<SurfaceSlice> slices;
  for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
    const std::uint32_t body = mesh.vertices[v].body;
    if (slices.empty() || slices.back().body != body || v - slices.back().first == most) slices.push_back({body, v, v});
    slices.back().end = v + 1;
  }
  return slices;
}

std::vector<std::byte> fill_pair_mesh(const PairMesh& mesh, std::size_t all_vertices, const PairRanges& ranges) {
  std::vector<glm::uvec4> edge_vertices;
  std::vector<glm::uvec2> around;
  std::vector<std::uint32_t> edge_bodies, first_around{0};
  for (const auto& [v, beside, body] : mesh.edges)
    edge_vertices.emplace_back(v[0], v[1], beside[0], beside[1]), edge_bodies.push_back(body);
  std::vector<std::vector<glm::uvec2>> at_vertex(all_vertices);
  for (const auto& triangle : mesh.triangles)
    for (std::size_t c = 0; c < 3; ++c)
      at_vertex[triangle[c]].emplace_back(triangle[(c + 1) % 3], triangle[(c + 2) % 3]);
  for (const auto& [vertex, body] : mesh.vertices) {
    around.insert(around.end(), at_vertex[vertex].begin(), at_vertex[vertex].end());
    first_around.push_back(std::uint32_t(around.size()));
  }
  std::vector<SurfaceBody> bodies;
  for (std::uint32_t b = 0, leaf = 0; b <= mesh.thicknesses.size(); ++b) {
    while (leaf < mesh.leaves.size() && mesh.leaves[leaf].body < b) ++leaf;
    bodies.push_back({b < mesh.thicknesses.size() ? mesh.thicknesses[b] : 0, leaf});
  }
  std::vector<std::byte> contents(ranges.mesh.bytes);
  put(contents, ranges.triangles, mesh.triangles);
  put(contents, ranges.edge_vertices, edge_vertices);
  put(contents, ranges.edge_bodies, edge_bodies);
  put(contents, ranges.surface_vertices, mesh.vertices);
  put(contents, ranges.first_around, first_around);
  put(contents, ranges.around, around);
  put(contents, ranges.leaves, mesh.leaves);
  put(contents, ranges.bodies, bodies);
  put(contents, ranges.slices, cut_slices(mesh));
  put(contents, ranges.behind, mesh.behind);
  put(contents, ranges.tet_vertices, mesh.tets);
  put(contents, ranges.tet_beyond, mesh.beyond);
  return contents;
}

std::vector<std::byte> make_empty_lists(const PairRanges& ranges) {
  CandidateCounts counts{};
  for (WorkGroups& groups : counts.groups) groups = {0, 1, 1};
  BodyBox box{};
  for (std::size_t c = 0; c < 3; ++c) box.low[c] = box.slowest[c] = ~0u;
  std::vector<std::byte> contents(ranges.boxes.at + ranges.boxes.bytes());
  put(contents, ranges.counts, std::vector{counts});
  put(contents, ranges.boxes, std::vector(ranges.boxes.count, box));
  return contents;
}

}  // namespace tetpbd
