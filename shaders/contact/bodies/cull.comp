// Lists pairs of leaves that are near each other, and how far their vertices may go until they are looked for again.
// There is a work-group per leaf.
#include "types.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#include "contact/bodies/proximity.glsl"
#define VISITS_LEAVES
#include "contact/bodies/reach.glsl"
#include "contact/bodies/listed.glsl"
layout(std430) restrict writeonly buffer LeafPairs { uvec2 leaf_pairs[]; };
shared bool is_near;
float branch_speed(uint branch) { return uintBitsToFloat(branches[branch].fastest); }
void hold_leaf(uint leaf) {
  for (uint t = leaves[leaf].triangles[0]; t < leaves[leaf].triangles[1]; ++t)
    for (int c = 0; c < 3; ++c) hold(triangles[leaf_triangles[t]][c], 0.0);
}
void visit(uint leaf, uint other) {
  float way = way_until_then(leaf_highs[leaf].w), other_way = way_until_then(leaf_highs[other].w),
        offset = leaf_offset(leaf, other);
  if (!are_near(leaf, other, offset + further_than_offset(leaf, other, way, other_way))) return;
  is_near = true;
  if (other < leaf || !are_near(leaf, other, offset + further_than_offset(leaf, other))) return;
  uint slot = atomicAdd(counts.leaf_pairs, 1u);
  atomicMax(totals.most_leaf_pairs, slot + 1u);
  if (slot < uint(leaf_pairs.length())) {
    leaf_pairs[slot] = uvec2(leaf, other);
    NEED_GROUPS(counts.leaf_pair_groups, slot + 1u)
  } else {
    hold_leaf(leaf), hold_leaf(other);
  }
}
void main() {
  uint leaf = group_index();
  if (leaf >= LEAVES) return;
  if (lane() == 0u) is_near = false;
  barrier();
  visit_near_leaves(leaf, leaf_highs[leaf].w);
  if (!is_near) return;
  uint limit = floatBitsToUint(limit_of(leaf_highs[leaf].w));
  for (uint t = leaves[leaf].triangles[0] + lane(); t < leaves[leaf].triangles[1]; t += GROUP_SIZE)
    for (int c = 0; c < 3; ++c) atomicMin(listed[4u * triangles[leaf_triangles[t]][c] + 3u], limit);
}
