// What the kernels of contact between bodies share (method.md, "Bodies in contact"). Once in up to four steps (sim/pairs.h) each
// vertex of a surface near another body finds the CANDIDATES nearest triangles, and each sharp edge such edges; in each substep the one that it is in
// pushes it out.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = GROUP_SIZE) in;
// Vertices of each triangle (x 3) and its body; sharp edges of solids: ends, third vertices of the triangles beside them, body; vertices of surfaces,
// each with its body; where the triangles around each vertex start, and of these the other two vertices in order; leaves (body, then first and end of their triangles, vertices and
// edges); of each body its thickness and its first leaf; slices of the vertices that belong to one body (body, first, end); the tet behind each
// triangle; tets: vertices, then the tets across from these.
layout(std430, binding = BIND_PAIR_MESH) restrict readonly buffer PairMesh { uint pair_mesh[]; };
uint triangle_vertex(uint t, uint corner) { return pair_mesh[4u * t + corner]; }
uint triangle_body(uint t) { return pair_mesh[4u * t + 3u]; }
uint tet_behind(uint t) { return pair_mesh[BEHIND_AT + t]; }
uint tet_vertex(uint tet, uint k) { return pair_mesh[TETS_AT + 8u * tet + k]; }
uint tet_beyond(uint tet, uint k) { return pair_mesh[TETS_AT + 8u * tet + 4u + k]; }
uint edge_vertex(uint e, uint k) { return pair_mesh[EDGES_AT + 5u * e + k]; }
uint edge_body(uint e) { return pair_mesh[EDGES_AT + 5u * e + 4u]; }
uint surface_vertex(uint s) { return pair_mesh[VERTICES_AT + 2u * s]; }
uint surface_body(uint s) { return pair_mesh[VERTICES_AT + 2u * s + 1u]; }
float thickness_of(uint body) { return uintBitsToFloat(pair_mesh[BODIES_AT + 2u * body]); }  // m, of a sheet, else 0
uint first_leaf(uint body) { return pair_mesh[BODIES_AT + 2u * body + 1u]; }
uint of_leaf(uint leaf, uint k) { return pair_mesh[LEAVES_AT + 7u * leaf + k]; }
// What may be in something: an ITEM is a vertex of a surface or, behind these, an edge; what it is in, a TARGET, a triangle or an edge.
#define ITEMS (SURFACE_VERTICES + EDGES)
bool item_is_edge(uint s) { return EDGES > 0u && s >= SURFACE_VERTICES; }
uint item_body(uint s) { return item_is_edge(s) ? edge_body(s - SURFACE_VERTICES) : surface_body(s); }
uint target_body(uint t) { return EDGES > 0u && t >= TRIANGLES ? edge_body(t - TRIANGLES) : triangle_body(t); }
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
layout(std430, binding = BIND_PAIR_SPHERES) restrict buffer PairSpheres { vec4 pair_spheres[]; };
// Counters; then of each body the box around its surface, that around the mean velocities of its slices, and how far from these the others are, as
// numbers that sort like the floats; then records of vertices that have candidates.
#define TOUCHING 0u       // contacts, of all substeps since
#define DEEPEST 1u        // m
#define NEAR_VERTICES 2u  // of leaves that are near another body, with what fills groups
#define RECORDS 3u
#define GROUPS 4u         // of work-groups for all records: three numbers for an indirect dispatch
#define LANE_GROUPS 7u    // the same with CANDIDATES invocations per record
#define QUERY_GROUPS 10u  // for the vertices of leaves that are near another body, LANES invocations each
#define EDGE_GROUPS 13u   // for their edges
#define NEAR_EDGES 16u
#define MOST_REACH 17u  // m, of any leaf
#define BOXES 18u
#define BOX 13u
#define RECORD (3u + CANDIDATES)  // item, the target it is in (NONE: none), the substep in which to look again, candidates
#define CANDIDATE 3u
#define NONE 0xffffffffu
#define BESIDE 0x80000000u  // of a candidate: it says whether the vertex is in the body, but does not push it
#define INSIDE BESIDE         // of a target that an item is in: tets say so, while its gap says that it is not
#define UNDER 0x40000000u   // of a sheet's triangle: the vertex belongs on the side where it winds clockwise
#define TARGET 0x3fffffffu
#define HELD (RECORDS_AT + RECORD * ITEMS)  // then, of each item, the target that it was in last, and how deep (m)
#define DEPTHS (HELD + ITEMS)
// Then the numbers of the vertices of leaves that are near another body, and of their edges; leaves in any order, each in work-groups of its own, filled
// with NONE.
#define PER_GROUP (GROUP_SIZE / LANES)
#define NEAR_AT (DEPTHS + ITEMS)
#define NEAR_EDGES_AT (NEAR_AT + SURFACE_VERTICES + LEAVES * PER_GROUP)
#define LEAF_BOXES (NEAR_EDGES_AT + EDGES + LEAVES * PER_GROUP)  // then low, high and reach of each leaf: how far its items look
// Then of each leaf how many are near it, and the first of these; and the leaf of each work-group of vertices and of edges.
#define NEAR_LEAVES_AT (LEAF_BOXES + 7u * LEAVES)
#define LEAF_OF_GROUP (NEAR_LEAVES_AT + (NEAR_LEAVES + 1u) * LEAVES)
#define LEAF_OF_EDGE_GROUP (LEAF_OF_GROUP + SURFACE_VERTICES / PER_GROUP + LEAVES)
layout(std430, binding = BIND_PAIR_LISTS) restrict buffer PairLists { uint pair_lists[]; };
#include "pairs/sums.glsl"
uniform float margin;  // m, how near a candidate is
float reach_of(float depth) { return max(margin, 1.05 * depth + 0.5 * margin); }  // of an item that is so deep in a body

// An indirect dispatch is to have so many work-groups, ROW of them in a row.
void need_groups(uint at, uint count) {
  atomicMax(pair_lists[at], min(count, ROW));
  if (count > ROW) atomicMax(pair_lists[at + 1u], (count + ROW - 1u) / ROW);
}
uint sortable(float x) {
  uint bits = floatBitsToUint(x);
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}
float unsorted(uint bits) { return uintBitsToFloat((bits & 0x80000000u) != 0u ? bits & 0x7fffffffu : ~bits); }
vec3 low_of_leaf(uint leaf) {
  uint k = LEAF_BOXES + 7u * leaf;
  return uintBitsToFloat(uvec3(pair_lists[k], pair_lists[k + 1u], pair_lists[k + 2u]));
}
vec3 high_of_leaf(uint leaf) {
  uint k = LEAF_BOXES + 7u * leaf + 3u;
  return uintBitsToFloat(uvec3(pair_lists[k], pair_lists[k + 1u], pair_lists[k + 2u]));
}
bool in_leaf(uint leaf, vec3 low, vec3 high) {
  return all(lessThanEqual(low, high_of_leaf(leaf))) && all(greaterThanEqual(high, low_of_leaf(leaf)));
}
bool in_body(uint body, vec3 low, vec3 high) {
  uint k = BOXES + BOX * body;
  vec3 lowest, highest;
  for (uint c = 0u; c < 3u; ++c) lowest[c] = unsorted(pair_lists[k + c]), highest[c] = unsorted(pair_lists[k + 3u + c]);
  return all(lessThanEqual(lowest, high)) && all(greaterThanEqual(highest, low));
}
