// Lists pairs of leaves that are near each other, and how far their vertices may go until they are looked for again.
// There is a work-group per leaf.
#include "types.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#include "contact/bodies/proximity.glsl"
#include "contact/bodies/reach.glsl"
layout(std430) restrict buffer Listed { uint listed[]; };  // four words a vertex
layout(std430) restrict writeonly buffer LeafPairs { uvec2 leaf_pairs[]; };
shared bool is_near;
void main() {
  uint leaf = group_index();
  if (leaf >= LEAVES) return;
  if (lane() == 0u) is_near = false;
  barrier();
  for (uint l = lane(); l < LEAVES; l += GROUP_SIZE) {
    float way = way_until_then(leaf_highs[leaf].w), other_way = way_until_then(leaf_highs[l].w),
          offset = leaf_offset(leaf, l);
    if (!may_touch(leaf, l) || !are_near(leaf, l, offset + further_than_offset(leaf, l, way, other_way))) continue;
    is_near = true;
    if (l < leaf || !are_near(leaf, l, offset + further_than_offset(leaf, l))) continue;
    uint slot = atomicAdd(counts.leaf_pairs, 1u);
    if (slot >= uint(leaf_pairs.length())) continue;
    leaf_pairs[slot] = uvec2(leaf, l);
    NEED_GROUPS(counts.leaf_pair_groups, TASKS * (slot + 1u))
  }
  barrier();
  if (!is_near) return;
  uint limit = floatBitsToUint(limit_of(leaf_highs[leaf].w));
  for (uint t = leaves[leaf].triangles[0] + lane(); t < leaves[leaf].triangles[1]; t += GROUP_SIZE)
    for (int c = 0; c < 3; ++c) atomicMin(listed[4u * triangles[leaf_triangles[t]][c] + 3u], limit);
}
