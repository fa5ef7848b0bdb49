// Which leaves are near one of another body; their targets and items are listed. Of what is near nothing, nothing is held. A work-group per leaf.
#include "pairs/pairs.glsl"
shared uint near, first_target, first_vertex, first_edge;
vec3 three(uint k) { return uintBitsToFloat(uvec3(pair_lists[k], pair_lists[k + 1u], pair_lists[k + 2u])); }
bool in_box(uint body, vec3 low, vec3 high) {
  uint k = BOXES + BOX * body;
  for (uint c = 0u; c < 3u; ++c)
    if (high[c] < unsorted(pair_lists[k + c]) || low[c] > unsorted(pair_lists[k + 3u + c])) return false;
  return true;
}
void main() {
  uint lane = gl_LocalInvocationIndex, leaf = group_index();
  if (leaf >= LEAVES) return;
  uint k = LEAF_BOXES + 7u * leaf, body = of_leaf(leaf, 0u);
  vec3 low = three(k), high = three(k + 3u);
  float reach = uintBitsToFloat(pair_lists[k + 6u]), most = uintBitsToFloat(pair_lists[MOST_REACH]);
  if (lane == 0u) near = CONTACT_SELF;
  barrier();
  bool found = false;
  for (uint other = 0u; other < BODY_COUNT && !found; ++other) {
    if (other == body || !in_box(other, low - most, high + most)) continue;
    for (uint l = first_leaf(other) + lane; l < first_leaf(other + 1u) && !found; l += GROUP_SIZE) {
      uint at = LEAF_BOXES + 7u * l;
      float apart = max(reach, uintBitsToFloat(pair_lists[at + 6u]));
      found = all(lessThanEqual(low - apart, three(at + 3u))) && all(greaterThanEqual(high + apart, three(at)));
    }
  }
  if (found) near = 1u;
  barrier();
  uint triangle = of_leaf(leaf, 1u), triangles = of_leaf(leaf, 2u) - triangle, vertex = of_leaf(leaf, 3u), vertices = of_leaf(leaf, 4u) - vertex;
  uint edge = of_leaf(leaf, 5u), edges = of_leaf(leaf, 6u) - edge;
  if (near == 0u) {
    for (uint j = lane; j < vertices; j += GROUP_SIZE) pair_lists[HELD + vertex + j] = NONE;
    for (uint j = lane; j < edges; j += GROUP_SIZE) pair_lists[HELD + SURFACE_VERTICES + edge + j] = NONE;
    return;
  }
  if (lane == 0u) {
    first_target = atomicAdd(pair_lists[NEAR_TARGETS], triangles + edges);
    first_vertex = atomicAdd(pair_lists[NEAR_VERTICES], vertices);
    first_edge = atomicAdd(pair_lists[NEAR_EDGES], edges);
    atomicMax(pair_lists[INSERT_GROUPS], (first_target + triangles + edges + GROUP_SIZE - 1u) / GROUP_SIZE);
    atomicMax(pair_lists[QUERY_GROUPS], ((first_vertex + vertices) * LANES + GROUP_SIZE - 1u) / GROUP_SIZE);
    if (edges > 0u) atomicMax(pair_lists[EDGE_GROUPS], ((first_edge + edges) * LANES + GROUP_SIZE - 1u) / GROUP_SIZE);
  }
  barrier();
  for (uint j = lane; j < triangles; j += GROUP_SIZE) pair_lists[TARGETS_AT + first_target + j] = triangle + j;
  for (uint j = lane; j < vertices; j += GROUP_SIZE) pair_lists[NEAR_AT + first_vertex + j] = vertex + j;
  for (uint j = lane; j < edges; j += GROUP_SIZE) {
    pair_lists[TARGETS_AT + first_target + triangles + j] = TRIANGLES + edge + j;
    pair_lists[NEAR_AT + SURFACE_VERTICES + first_edge + j] = SURFACE_VERTICES + edge + j;
  }
}
