// Which leaves are near one of another body; their items are listed. Of what is near nothing, nothing is held. A work-group per leaf.
#include "pairs/pairs.glsl"
shared uint near, first_vertex, first_edge;
void main() {
  uint lane = gl_LocalInvocationIndex, leaf = group_index();
  if (leaf >= LEAVES) return;
  uint body = of_leaf(leaf, 0u);
  vec3 low = low_of_leaf(leaf), high = high_of_leaf(leaf);
  float reach = uintBitsToFloat(pair_lists[LEAF_BOXES + 7u * leaf + 6u]), most = uintBitsToFloat(pair_lists[MOST_REACH]);
  if (lane == 0u) near = CONTACT_SELF;
  barrier();
  bool found = false;
  for (uint other = 0u; other < BODY_COUNT && !found; ++other) {
    if (other == body || !in_body(other, low - most, high + most)) continue;
    for (uint l = first_leaf(other) + lane; l < first_leaf(other + 1u) && !found; l += GROUP_SIZE) {
      float apart = max(reach, uintBitsToFloat(pair_lists[LEAF_BOXES + 7u * l + 6u]));
      found = in_leaf(l, low - apart, high + apart);
    }
  }
  if (found) near = 1u;
  barrier();
  uint vertex = of_leaf(leaf, 3u), vertices = of_leaf(leaf, 4u) - vertex, edge = of_leaf(leaf, 5u), edges = of_leaf(leaf, 6u) - edge;
  if (near == 0u) {
    for (uint j = lane; j < vertices; j += GROUP_SIZE) pair_lists[HELD + vertex + j] = NONE;
    for (uint j = lane; j < edges; j += GROUP_SIZE) pair_lists[HELD + SURFACE_VERTICES + edge + j] = NONE;
    return;
  }
  uint vertices_filled = (vertices + PER_GROUP - 1u) / PER_GROUP * PER_GROUP, edges_filled = (edges + PER_GROUP - 1u) / PER_GROUP * PER_GROUP;
  if (lane == 0u) {
    first_vertex = atomicAdd(pair_lists[NEAR_VERTICES], vertices_filled);
    first_edge = atomicAdd(pair_lists[NEAR_EDGES], edges_filled);
    need_groups(QUERY_GROUPS, (first_vertex + vertices_filled) / PER_GROUP);
    if (edges > 0u) need_groups(EDGE_GROUPS, (first_edge + edges_filled) / PER_GROUP);
  }
  barrier();
  for (uint j = lane; j < vertices_filled; j += GROUP_SIZE) pair_lists[NEAR_AT + first_vertex + j] = j < vertices ? vertex + j : NONE;
  for (uint j = lane; j < edges_filled; j += GROUP_SIZE) pair_lists[NEAR_EDGES_AT + first_edge + j] = j < edges ? SURFACE_VERTICES + edge + j : NONE;
}
