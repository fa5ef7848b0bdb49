// What the kernels of contact between bodies share (method.md, "Bodies in contact"). Once a step, or more often where bodies are fast, each
// vertex of a surface near another body finds the CANDIDATES nearest triangles, and each sharp edge such edges; in each substep the one that it is in
// pushes it out.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = GROUP_SIZE) in;
// Vertices of each triangle (x 3) and its body; sharp edges of solids: ends, third vertices of the triangles beside them, body; vertices of surfaces,
// each with its body; slices of these that belong to one body (body, first, end); the thickness of each body.
layout(std430, binding = BIND_PAIR_MESH) restrict readonly buffer PairMesh { uint pair_mesh[]; };
uint triangle_vertex(uint t, uint corner) { return pair_mesh[4u * t + corner]; }
uint triangle_body(uint t) { return pair_mesh[4u * t + 3u]; }
uint edge_vertex(uint e, uint k) { return pair_mesh[EDGES_AT + 5u * e + k]; }
uint edge_body(uint e) { return pair_mesh[EDGES_AT + 5u * e + 4u]; }
uint surface_vertex(uint s) { return pair_mesh[VERTICES_AT + 2u * s]; }
uint surface_body(uint s) { return pair_mesh[VERTICES_AT + 2u * s + 1u]; }
float thickness_of(uint body) { return uintBitsToFloat(pair_mesh[THICKNESSES_AT + body]); }  // m, of a sheet, else 0
// What may be in something: an ITEM is a vertex of a surface or, behind these, an edge; what it is in, a TARGET, a triangle or an edge.
#define ITEMS (SURFACE_VERTICES + EDGES)
#define TARGETS (TRIANGLES + EDGES)
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
// First entry of each cell (a hash of where it is) plus 1; normals of vertices, of 4096 for each of their triangles; then entries (triangle; its body
// and, along each axis, whether the cell is the first that it is in; the next plus 1). Their order is chance, and plays no part.
layout(std430, binding = BIND_PAIR_GRID) restrict buffer PairGrid { uint pair_grid[]; };
// Counters; then of each body the box around its surface, that around the mean velocities of its slices, and how far from these the others are, as
// numbers that sort like the floats; then records of vertices that have candidates.
#define ENTRIES 0u     // of the grid
#define RECORDS 1u
#define GROUPS 2u      // of work-groups for all records: three numbers for an indirect dispatch
#define LANE_GROUPS 5u // the same with CANDIDATES invocations per record
#define OVERFLOWN 8u   // entries that had no room
#define TOUCHING 9u    // contacts, of all substeps since
#define DEEPEST 10u    // m, as sortable
#define BOXES 11u
#define BOX 13u
#define RECORD (2u + CANDIDATES)  // item, the target it is in (NONE: none), candidates
#define NONE 0xffffffffu
#define BESIDE 0x80000000u  // of a candidate: it says whether the vertex is in the body, but does not push it
#define UNDER 0x40000000u   // of a sheet's triangle: the vertex belongs on the side where it winds clockwise
#define TARGET 0x3fffffffu
#define HELD (RECORDS_AT + RECORD * ITEMS)  // then, of each item, the target that it was in last
layout(std430, binding = BIND_PAIR_LISTS) restrict buffer PairLists { uint pair_lists[]; };
// By vertex: the sum of what stops it in 32nds of a quantum, how many contacts it is part of, and the sum of what pushes it beside.
#define PARTS 32.0
layout(std430, binding = BIND_PAIR_SUMS) restrict buffer PairSums { int pair_sums[]; };
uniform float margin;  // m, how near a candidate is

uint sortable(float x) {
  uint bits = floatBitsToUint(x);
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}
float unsorted(uint bits) { return uintBitsToFloat((bits & 0x80000000u) != 0u ? bits & 0x7fffffffu : ~bits); }
bool in_box(uint body, vec3 low, vec3 high) {
  uint k = BOXES + BOX * body;
  for (uint c = 0u; c < 3u; ++c)
    if (high[c] < unsorted(pair_lists[k + c]) || low[c] > unsorted(pair_lists[k + 3u + c])) return false;
  return true;
}
// Whether another body is there, or this one is asked for as well.
bool near_another(uint body, vec3 low, vec3 high) {
#if CONTACT_SELF
  return true;
#else
  for (uint other = 0u; other < BODY_COUNT; ++other)
    if (other != body && in_box(other, low, high)) return true;
  return false;
#endif
}
ivec3 cell_of(vec3 x) { return ivec3(floor(x / CELL)); }
#define FIRST_ALONG_X 0x20000000u
#define BODY_OF_ENTRY 0x1fffffffu
uint hash_of(ivec3 cell) {
  uvec3 u = uvec3(cell) * uvec3(73856093u, 19349663u, 83492791u);
  uint h = u.x ^ u.y ^ u.z;
  return (h ^ (h >> 15)) & (CELLS - 1u);
}
