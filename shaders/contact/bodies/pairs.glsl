// What the kernels of contact between bodies share (method.md, "Bodies in contact"; sim/contact/pairs.h).
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
uint triangle_body(uint t) { return triangles[t].w; }
uint surface_vertex(uint s) { return surface_vertices[s].x; }
uint surface_body(uint s) { return surface_vertices[s].y; }
float thickness_of(uint body) { return bodies[body].thickness; }
bool item_is_edge(uint s) { return EDGES > 0u && s >= SURFACE_VERTICES; }
uint item_body(uint s) { return item_is_edge(s) ? edge_bodies[s - SURFACE_VERTICES] : surface_body(s); }
uint target_body(uint t) { return EDGES > 0u && t >= TRIANGLES ? edge_bodies[t - TRIANGLES] : triangle_body(t); }
// The vertices of a contact: of an item that is a vertex and its triangle, or the ends of both edges.
uvec4 contact_vertices(uint s, uint t) {
  if (item_is_edge(s)) return uvec4(edge_vertices[s - SURFACE_VERTICES].xy, edge_vertices[t - TRIANGLES].xy);
  return uvec4(surface_vertex(s), triangles[t].xyz);
}
#if EDGES
// Third vertices of the triangles beside two edges.
uvec4 vertices_beside(uint s, uint t) {
  if (!item_is_edge(s)) return uvec4(0u);
  return uvec4(edge_vertices[s - SURFACE_VERTICES].zw, edge_vertices[t - TRIANGLES].zw);
}
#endif
// Around each target: centre, radius (m).
layout(std430) restrict buffer PairSpheres { vec4 pair_spheres[]; };
#include "contact/bodies/sums.glsl"
uniform float margin;  // m, within which targets are candidates
// m, the search radius of an item that is so deep in a body.
float reach_of(float depth) { return max(margin, 1.05 * depth + 0.5 * margin); }

// Makes an indirect dispatch have so many work-groups, ROW of them in a row.
void need_groups(uint which, uint count) {
  atomicMax(counts.groups[which].x, min(count, ROW));
  if (count > ROW) atomicMax(counts.groups[which].y, (count + ROW - 1u) / ROW);
}
uint sortable(float x) {
  uint bits = floatBitsToUint(x);
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}
float unsorted(uint bits) { return uintBitsToFloat((bits & 0x80000000u) != 0u ? bits & 0x7fffffffu : ~bits); }
vec3 leaf_low(uint leaf) { return vec3(leaf_boxes[leaf].low[0], leaf_boxes[leaf].low[1], leaf_boxes[leaf].low[2]); }
vec3 leaf_high(uint leaf) { return vec3(leaf_boxes[leaf].high[0], leaf_boxes[leaf].high[1], leaf_boxes[leaf].high[2]); }
bool overlap(vec3 low, vec3 high, vec3 other_low, vec3 other_high) {
  return all(lessThanEqual(low, other_high)) && all(greaterThanEqual(high, other_low));
}
bool is_in_leaf(uint leaf, vec3 low, vec3 high) { return overlap(low, high, leaf_low(leaf), leaf_high(leaf)); }
bool is_in_body(uint body, vec3 low, vec3 high) {
  vec3 lowest, highest;
  for (uint c = 0u; c < 3u; ++c)
    lowest[c] = unsorted(boxes[body].low[c]), highest[c] = unsorted(boxes[body].high[c]);
  return overlap(low, high, lowest, highest);
}
