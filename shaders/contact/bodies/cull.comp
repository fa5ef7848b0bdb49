// Broad phase: lists for each leaf the leaves of other bodies near it, and lists its items if there are any; else they
// are in nothing. There is a work-group per leaf.
#include "contact/bodies/pairs.glsl"
#define BODY_WORDS ((BODY_COUNT + 31u) / 32u)
shared uint near_bodies[BODY_WORDS];  // a bit per body
shared uint near, first_vertex, first_edge;
void clear_targets(uint lane, uint item, uint count) {
  for (uint j = lane; j < count; j += GROUP_SIZE) held_by[item + j] = NONE;
}
uint round_up(uint count) { return (count + PER_GROUP - 1u) / PER_GROUP * PER_GROUP; }
void main() {
  uint lane = gl_LocalInvocationIndex, leaf = group_index();
  if (leaf >= LEAVES) return;
  uint body = leaves[leaf].body;
  vec3 low = leaf_low(leaf), high = leaf_high(leaf);
  float reach = leaf_boxes[leaf].reach, most = uintBitsToFloat(counts.most_reach);
  if (lane == 0u) near = 0u;
  for (uint w = lane; w < BODY_WORDS; w += GROUP_SIZE) near_bodies[w] = 0u;
  barrier();
  for (uint other = lane; other < BODY_COUNT; other += GROUP_SIZE)
    if ((CONTACT_SELF != 0 || other != body) && is_in_body(other, low - most, high + most))
      atomicOr(near_bodies[other / 32u], 1u << (other % 32u));
  barrier();
  for (uint w = 0u; w < BODY_WORDS; ++w)
    for (uint left = near_bodies[w]; left != 0u; left &= left - 1u) {
      uint other = 32u * w + uint(findLSB(left));
      for (uint l = bodies[other].first_leaf + lane; l < bodies[other + 1u].first_leaf; l += GROUP_SIZE) {
        float apart = max(reach, leaf_boxes[l].reach);
        if (!is_in_leaf(l, low - apart, high + apart)) continue;
        uint slot = atomicAdd(near, 1u);
        if (slot < NEAR_LEAVES) near_leaves[leaf].leaves[slot] = l;
      }
    }
  barrier();
  uint vertex = leaves[leaf].vertices[0], vertices = leaves[leaf].vertices[1] - vertex;
  uint edge = leaves[leaf].edges[0], edges = leaves[leaf].edges[1] - edge;
  if (near == 0u) {
    clear_targets(lane, vertex, vertices);
    clear_targets(lane, SURFACE_VERTICES + edge, edges);
    return;
  }
  uint vertices_filled = round_up(vertices), edges_filled = round_up(edges);
  if (lane == 0u) {
    near_leaves[leaf].count = near;
    first_vertex = atomicAdd(counts.near_vertices, vertices_filled);
    need_groups(QUERY_GROUPS, (first_vertex + vertices_filled) / PER_GROUP);
    if (edges > 0u) {
      first_edge = atomicAdd(counts.near_edges, edges_filled);
      need_groups(EDGE_GROUPS, (first_edge + edges_filled) / PER_GROUP);
    }
  }
  barrier();
  for (uint j = lane; j < vertices_filled; j += GROUP_SIZE)
    near_vertices[first_vertex + j] = j < vertices ? vertex + j : NONE;
  for (uint j = lane; j < vertices_filled / PER_GROUP; j += GROUP_SIZE)
    leaf_of_group[first_vertex / PER_GROUP + j] = leaf;
  for (uint j = lane; j < edges_filled; j += GROUP_SIZE)
    near_edges[first_edge + j] = j < edges ? SURFACE_VERTICES + edge + j : NONE;
  for (uint j = lane; j < edges_filled / PER_GROUP; j += GROUP_SIZE)
    leaf_of_edge_group[first_edge / PER_GROUP + j] = leaf;
}
