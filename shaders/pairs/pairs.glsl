// What the kernels of contact between bodies share (method.md, "Bodies in contact"). Once a step, or more often where bodies are fast, each
// vertex of a surface near another body finds the CANDIDATES nearest triangles; in each substep the one that it is in pushes it out.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = GROUP_SIZE) in;
// Vertices of each triangle (x 3) and its body; vertices of surfaces, with body and thickness; slices of those lists that belong to one body
// (body, first, end).
layout(std430, binding = BIND_PAIR_MESH) restrict readonly buffer PairMesh { uint pair_mesh[]; };
uint triangle_vertex(uint t, uint corner) { return pair_mesh[4u * t + corner]; }
uint triangle_body(uint t) { return pair_mesh[4u * t + 3u]; }
uint surface_vertex(uint s) { return pair_mesh[VERTICES_AT + 3u * s]; }
uint surface_body(uint s) { return pair_mesh[VERTICES_AT + 3u * s + 1u]; }
float surface_thickness(uint s) { return uintBitsToFloat(pair_mesh[VERTICES_AT + 3u * s + 2u]); }  // m, of a sheet, else 0
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
#define RECORD (2u + CANDIDATES)  // vertex of a surface, the one it is in (NONE: none), candidates
#define NONE 0xffffffffu
#define BESIDE 0x80000000u  // of a candidate: it says whether the vertex is in the body, but does not push it
#define HELD (RECORDS_AT + RECORD * SURFACE_VERTICES)  // then, of each vertex of a surface, the triangle that it was in last
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
