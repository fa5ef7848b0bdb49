// shaders/contact/bodies/layout.glsl as C++, and the layout of the buffers of contact between bodies (surfaces.glsl and
// sums.glsl in the same folder).
#pragma once

#include "sim/gl/buffer_layout.h"

namespace tetpbd {

namespace pair_layout {
using glm::uint;
#include "shaders/contact/bodies/layout.glsl"
static_assert(sizeof(SurfaceLeaf) == 28 && sizeof(SurfaceBody) == 8 && sizeof(SurfaceSlice) == 12);
static_assert(sizeof(ContactTotals) == 12 && sizeof(CandidateCounts) == 64 && sizeof(BodyBox) == 56);
static_assert(sizeof(LeafBox) == 28 && sizeof(NearLeaves) == 256 && sizeof(ContactRecord) == 44);
static_assert(sizeof(ContactSums) == 28);
}  // namespace pair_layout

struct PairMesh;
struct PairSizes {
  std::size_t triangles, edges, vertices, leaves, slices, tets, bodies;
  std::size_t all_vertices;                 ///< inner ones among them
  std::size_t lanes;                        ///< invocations that find the candidates of an item
  static constexpr std::size_t group = 64;  ///< invocations of a work-group
  std::size_t items() const { return vertices + edges; }
  std::size_t targets() const { return triangles + edges; }
};
std::vector<std::string> pair_defines(const PairSizes& sizes);

struct PairRanges {
  BufferLayout mesh, lists, sums;
  Range<glm::uvec4> triangles, edge_vertices, tet_vertices, tet_beyond;
  Range<std::uint32_t> edge_bodies, first_around, behind;
  Range<glm::uvec2> surface_vertices, around;
  Range<pair_layout::SurfaceLeaf> leaves;
  Range<pair_layout::SurfaceBody> bodies;
  Range<pair_layout::SurfaceSlice> slices;
  Range<pair_layout::ContactTotals> totals;  ///< this and the following of `lists`
  Range<pair_layout::CandidateCounts> counts;
  Range<pair_layout::BodyBox> boxes;
  Range<float> depths;
  Range<pair_layout::ContactRecord> records;
  Range<std::int32_t> sharing;  ///< of `sums`
};
PairRanges lay_out_pairs(const PairSizes& sizes);

/// The surface's vertices in parts of at most 1024, each of one body.
std::vector<pair_layout::SurfaceSlice> cut_slices(const PairMesh& mesh);
/// The contents of `mesh` of PairRanges.
std::vector<std::byte> fill_pair_mesh(const PairMesh& mesh, std::size_t all_vertices, const PairRanges& ranges);
/// The contents of `lists` up to the end of boxes, without contacts and with empty boxes.
std::vector<std::byte> make_empty_lists(const PairRanges& ranges);

}  // namespace tetpbd
