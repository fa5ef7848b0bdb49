// Which leaves are near one of another body; their items and these leaves are listed. Of what is near nothing, nothing is held. A work-group per leaf.
#include "pairs/pairs.glsl"
#define BODY_WORDS ((BODY_COUNT + 31u) / 32u)
shared uint near_bodies[BODY_WORDS];  // a bit per body
shared uint near, first_vertex, first_edge;
// Lists a leaf's items from `first` on; of what is left of the last work-group, NONE.
void list_items(uint lane, uint list, uint groups, uint first, uint item, uint count, uint filled, uint leaf) {
  for (uint j = lane; j < filled; j += GROUP_SIZE) pair_lists[list + first + j] = j < count ? item + j : NONE;
  for (uint j = lane; j < filled / PER_GROUP; j += GROUP_SIZE) pair_lists[groups + first / PER_GROUP + j] = leaf;
}
void main() {
  uint lane = gl_LocalInvocationIndex, leaf = group_index();
  if (leaf >= LEAVES) return;
  uint body = of_leaf(leaf, 0u), list = NEAR_LEAVES_AT + (NEAR_LEAVES + 1u) * leaf;
  vec3 low = low_of_leaf(leaf), high = high_of_leaf(leaf);
  float reach = uintBitsToFloat(pair_lists[LEAF_BOXES + 7u * leaf + 6u]), most = uintBitsToFloat(pair_lists[MOST_REACH]);
  if (lane == 0u) near = 0u;
  for (uint w = lane; w < BODY_WORDS; w += GROUP_SIZE) near_bodies[w] = 0u;
  barrier();
  for (uint other = lane; other < BODY_COUNT; other += GROUP_SIZE)
    if ((CONTACT_SELF != 0 || other != body) && in_body(other, low - most, high + most)) atomicOr(near_bodies[other / 32u], 1u << (other % 32u));
  barrier();
  for (uint w = 0u; w < BODY_WORDS; ++w)
    for (uint left = near_bodies[w]; left != 0u; left &= left - 1u) {
      uint other = 32u * w + uint(findLSB(left));
      for (uint l = first_leaf(other) + lane; l < first_leaf(other + 1u); l += GROUP_SIZE) {
        float apart = max(reach, uintBitsToFloat(pair_lists[LEAF_BOXES + 7u * l + 6u]));
        if (!in_leaf(l, low - apart, high + apart)) continue;
        uint slot = atomicAdd(near, 1u);
        if (slot < NEAR_LEAVES) pair_lists[list + 1u + slot] = l;
      }
    }
  barrier();
  uint vertex = of_leaf(leaf, 3u), vertices = of_leaf(leaf, 4u) - vertex, edge = of_leaf(leaf, 5u), edges = of_leaf(leaf, 6u) - edge;
  if (near == 0u) {
    for (uint j = lane; j < vertices; j += GROUP_SIZE) pair_lists[HELD + vertex + j] = NONE;
    for (uint j = lane; j < edges; j += GROUP_SIZE) pair_lists[HELD + SURFACE_VERTICES + edge + j] = NONE;
    return;
  }
  uint vertices_filled = (vertices + PER_GROUP - 1u) / PER_GROUP * PER_GROUP, edges_filled = (edges + PER_GROUP - 1u) / PER_GROUP * PER_GROUP;
  if (lane == 0u) {
    pair_lists[list] = near;
    first_vertex = atomicAdd(pair_lists[NEAR_VERTICES], vertices_filled);
    need_groups(QUERY_GROUPS, (first_vertex + vertices_filled) / PER_GROUP);
    if (edges > 0u) {
      first_edge = atomicAdd(pair_lists[NEAR_EDGES], edges_filled);
      need_groups(EDGE_GROUPS, (first_edge + edges_filled) / PER_GROUP);
    }
  }
  barrier();
  list_items(lane, NEAR_AT, LEAF_OF_GROUP, first_vertex, vertex, vertices, vertices_filled, leaf);
  if (edges > 0u) list_items(lane, NEAR_EDGES_AT, LEAF_OF_EDGE_GROUP, first_edge, SURFACE_VERTICES + edge, edges, edges_filled, leaf);
}
