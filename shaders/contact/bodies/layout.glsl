// What the buffers of contact between bodies are made of, for GLSL and C++ (sim/contact/pair_layout.h). Units are SI.
#ifndef PAIR_LAYOUT
#define PAIR_LAYOUT
const uint CANDIDATES = 8u;    // of an item
const uint NEAR_LEAVES = 63u;  // listed by a leaf
const uint NONE = 0xffffffffu;
const uint BESIDE = 0x80000000u;  // of a candidate: it tells whether the vertex is in the body, but does not push it
const uint INSIDE = BESIDE;       // of an item's target: a tet shows that the item is inside although its gap does not
const uint UNDER = 0x40000000u;   // of a sheet's triangle: the vertex belongs on the side where it winds clockwise
const uint TARGET = 0x3fffffffu;  // the number without these bits

// About 64 triangles that are together at rest, with the vertices and edges of no earlier leaf: first and end.
struct SurfaceLeaf {
  uint body, triangles[2], vertices[2], edges[2];
};
struct SurfaceBody {
  float thickness;  // m, of a sheet, else 0
  uint first_leaf;
};
struct SurfaceSlice {
  uint body, first, end;  // vertices, all of one body
};

// Of all substeps since the last readback.
struct ContactTotals {
  uint touching;  // active contacts
  uint deepest;   // m, a float's bits
  uint crowded;   // full lists of candidates among which some cannot push
};
// Three numbers for an indirect dispatch.
struct WorkGroups {
  uint x, y, z;
};
const uint RECORD_GROUPS = 0u;  // an invocation per record
const uint LANE_GROUPS = 1u;    // CANDIDATES per record
const uint QUERY_GROUPS = 2u;   // LANES per vertex of leaves that are near another body
const uint EDGE_GROUPS = 3u;    // LANES per edge of these leaves
struct CandidateCounts {
  uint near_vertices;  // of leaves that are near another body, with the entries that fill groups
  uint near_edges;
  uint records;
  uint most_reach;  // m, of any leaf; a float's bits
  WorkGroups groups[4];
};
// The box around the surface of a body and that around the mean velocities of its slices, as integers in the order of
// the floats; then in m/s, as a float's bits, how far from these velocities vertices are, and the largest speed.
struct BodyBox {
  uint low[3], high[3], slowest[3], fastest[3], spread, top_speed;
};
struct LeafBox {
  float low[3], high[3], reach;  // reach: the largest search radius of its items
};
struct NearLeaves {
  uint count, leaves[NEAR_LEAVES];  // count may exceed NEAR_LEAVES
};
// Of an item that has candidates.
struct ContactRecord {
  uint item;
  uint target;  // that it is in, with its bits, or NONE
  uint next;    // substep of its next narrow phase
  uint candidates[CANDIDATES];
};
// The sum of contact corrections of a vertex, in SUM_PARTS of a quantum.
struct ContactSums {
  int stopped[3];  // those that change its velocity as well
  int pushed[3];
  int readers;  // invocations that have not yet read its position
};
#endif
