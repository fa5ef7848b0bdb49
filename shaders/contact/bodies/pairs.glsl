// What the kernels of contact between bodies share (method.md, "Bodies in contact"). Once in up to four steps
// (sim/contact/pairs.h) each vertex of a surface near another body finds the CANDIDATES nearest triangles, and each
// sharp edge such edges; in each substep the one that it is in pushes it out.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
uint triangle_vertex(uint t, uint corner) { return triangles[t][corner]; }
uint triangle_body(uint t) { return triangles[t].w; }
uint edge_vertex(uint e, uint k) { return edge_vertices[e][k]; }
uint surface_vertex(uint s) { return surface_vertices[s].x; }
uint surface_body(uint s) { return surface_vertices[s].y; }
float thickness_of(uint body) { return bodies[body].thickness; }
bool item_is_edge(uint s) { return EDGES > 0u && s >= SURFACE_VERTICES; }
uint item_body(uint s) { return item_is_edge(s) ? edge_bodies[s - SURFACE_VERTICES] : surface_body(s); }
uint target_body(uint t) { return EDGES > 0u && t >= TRIANGLES ? edge_bodies[t - TRIANGLES] : triangle_body(t); }
// Their vertices: that of the item and the triangle's, or the ends of both edges.
uvec4 vertices_of(uint s, uint t) {
  if (item_is_edge(s)) {
    uint own = s - SURFACE_VERTICES, other = t - TRIANGLES;
    return uvec4(edge_vertex(own, 0u), edge_vertex(own, 1u), edge_vertex(other, 0u), edge_vertex(other, 1u));
  }
  return uvec4(surface_vertex(s), triangle_vertex(t, 0u), triangle_vertex(t, 1u), triangle_vertex(t, 2u));
}
#if EDGES
// Third vertices of the triangles beside an edge and those beside another.
uvec4 beside_of(uint s, uint t) {
  if (!item_is_edge(s)) return uvec4(0u);
  uint own = s - SURFACE_VERTICES, other = t - TRIANGLES;
  return uvec4(edge_vertex(own, 2u), edge_vertex(own, 3u), edge_vertex(other, 2u), edge_vertex(other, 3u));
}
#endif
// Around each target: centre, radius (m).
layout(std430) restrict buffer PairSpheres { vec4 pair_spheres[]; };
#include "contact/bodies/sums.glsl"
uniform float margin;  // m, how near a candidate is
// m, of an item that is so deep in a body.
float reach_of(float depth) { return max(margin, 1.05 * depth + 0.5 * margin); }

// An indirect dispatch is to have so many work-groups, ROW of them in a row.
void need_groups(uint which, uint count) {
  atomicMax(counts.groups[which].x, min(count, ROW));
  if (count > ROW) atomicMax(counts.groups[which].y, (count + ROW - 1u) / ROW);
}
uint sortable(float x) {
  uint bits = floatBitsToUint(x);
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}
float unsorted(uint bits) { return uintBitsToFloat((bits & 0x80000000u) != 0u ? bits & 0x7fffffffu : ~bits); }
vec3 low_of_leaf(uint leaf) { return vec3(leaf_boxes[leaf].low[0], leaf_boxes[leaf].low[1], leaf_boxes[leaf].low[2]); }
vec3 high_of_leaf(uint leaf) {
  return vec3(leaf_boxes[leaf].high[0], leaf_boxes[leaf].high[1], leaf_boxes[leaf].high[2]);
}
bool in_leaf(uint leaf, vec3 low, vec3 high) {
  return all(lessThanEqual(low, high_of_leaf(leaf))) && all(greaterThanEqual(high, low_of_leaf(leaf)));
}
bool in_body(uint body, vec3 low, vec3 high) {
  vec3 lowest, highest;
  for (uint c = 0u; c < 3u; ++c)
    lowest[c] = unsorted(boxes[body].low[c]), highest[c] = unsorted(boxes[body].high[c]);
  return all(lessThanEqual(lowest, high)) && all(greaterThanEqual(highest, low));
}
