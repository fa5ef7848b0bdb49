// shaders/contact/bodies/layout.glsl as C++, and the layout of the buffers of contact between bodies (surfaces.glsl in
// the same folder).
#pragma once

#include "sim/contact/surfaces.h"
#include "sim/gl/buffer_layout.h"

namespace tetpbd {

namespace pair_layout {
using glm::uint;
using glm::uvec4;
using glm::vec3;
using glm::vec4;
#include "shaders/contact/bodies/layout.glsl"
static_assert(sizeof(SurfaceLeaf) == 32 && sizeof(ContactTotals) == 28 && sizeof(PairCounts) == 48);
static_assert(sizeof(SurfacePair) == 64 && sizeof(PairSums) == 56);
static_assert(sizeof(HardPair) == 144 && sizeof(KeptImpulse) == 32);
}  // namespace pair_layout

/// Parts of surfaces in leaves: about 64 triangles that are together at rest, with the vertices and edges of no earlier
/// leaf.
struct SurfaceLeaves {
  std::vector<pair_layout::SurfaceLeaf> leaves;  ///< body by body
  std::vector<std::uint32_t> triangles, vertices, edges;
};
SurfaceLeaves cut_leaves(const Model& model, const Surfaces& surfaces);

struct PairSizes {
  std::size_t triangles, edges, surface_vertices;
  std::size_t vertices, places;  ///< inner ones among them; once more where bodies touch themselves
  std::size_t leaves;
  std::size_t branches() const { return (leaves + pair_layout::BRANCH - 1) / pair_layout::BRANCH; }
};
std::vector<std::string> pair_defines(const PairSizes& sizes);

struct PairRanges {
  BufferLayout mesh, lists;
  Range<glm::uvec4> triangles, edges;
  Range<glm::vec4> places;
  Range<std::uint32_t> triangle_edges, own_triangle, first_neighbour, neighbours, leaf_triangles, leaf_vertices,
      leaf_edges;
  Range<float> offsets;
  Range<pair_layout::SurfaceLeaf> leaves;
  Range<glm::vec4> leaf_lows, leaf_highs;  ///< these and the following of `lists`
  Range<pair_layout::ContactTotals> totals;
  Range<pair_layout::PairCounts> counts;
  Range<pair_layout::SurfaceBranch> branches;
};
PairRanges lay_out_pairs(const PairSizes& sizes);
/// The contents of `mesh` of PairRanges.
std::vector<std::byte> fill_pair_mesh(const Model& model, const Surfaces& surfaces, const SurfaceLeaves& leaves,
                                      const PairRanges& ranges);
/// The contents of `lists` before anything is found.
std::vector<std::byte> make_empty_lists(const PairRanges& ranges);

}  // namespace tetpbd
