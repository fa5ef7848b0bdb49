// What the buffers of contact between bodies are made of, read by GLSL and by C++ (sim/contact/pair_layout.h). Units
// are SI.
#ifndef PAIR_LAYOUT
#define PAIR_LAYOUT
const uint CANDIDATES = 8u;    // targets that an item keeps
const uint NEAR_LEAVES = 63u;  // that a leaf lists
const uint NONE = 0xffffffffu;
const uint BESIDE = 0x80000000u;  // of a candidate: it says whether the vertex is in the body, but does not push it
const uint INSIDE = BESIDE;       // of a target that an item is in: tets say so, while its gap says that it is not
const uint UNDER = 0x40000000u;   // of a sheet's triangle: the vertex belongs on the side where it winds clockwise
const uint TARGET = 0x3fffffffu;  // the number without these bits

// Some 64 triangles that are together at rest, with the vertices and edges that no leaf before has: first and end.
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

// Contacts of all substeps since they were last read.
struct ContactTotals {
  uint touching;
  uint deepest;  // m, a float's bits
  uint crowded;  // lists of candidates that were full, with some that push nothing
};
// Three numbers for an indirect dispatch.
struct WorkGroups {
  uint x, y, z;
};
const uint RECORD_GROUPS = 0u;  // an invocation per record
const uint LANE_GROUPS = 1u;    // CANDIDATES
const uint QUERY_GROUPS = 2u;   // LANES per vertex of leaves that are near another body
const uint EDGE_GROUPS = 3u;    // and per edge
struct CandidateCounts {
  uint near_vertices;  // of leaves that are near another body, with what fills groups
  uint near_edges;
  uint records;
  uint most_reach;  // m, of any leaf; a float's bits
  WorkGroups groups[4];
};
// The box around the surface of a body and that around the mean velocities of its slices, as numbers that sort like
// the floats; and how far from these the others are (m/s), a float's bits.
struct BodyBox {
  uint low[3], high[3], slowest[3], fastest[3], spread, top;  // top: of any vertex (m/s), a float's bits
};
struct LeafBox {
  float low[3], high[3], reach;  // reach: how far its items look
};
struct NearLeaves {
  uint count, leaves[NEAR_LEAVES];  // count may be more
};
// Of an item that has candidates.
struct ContactRecord {
  uint item;
  uint target;  // that it is in, with its bits, or NONE
  uint next;    // substep in which to look again
  uint candidates[CANDIDATES];
};
// What contacts add up for a vertex, in 32nds of a quantum.
struct ContactSums {
  int stopped[3];  // what changes its velocity as well
  int pushed[3];
  int asks;  // invocations that have not yet read where it is
};
#endif
