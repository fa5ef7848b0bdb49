// What the buffers of contact between bodies are made of, for GLSL and C++ (sim/contact/pair_layout.h). Units are SI.
#ifndef PAIR_LAYOUT
#define PAIR_LAYOUT
const uint NONE = 0xffffffffu;
const uint OF_EDGES = 0x80000000u;   // of a pair's first part: two edges, else a vertex and a triangle
const uint SAME_BODY = 0x80000000u;  // of a candidate's second part
const uint BRANCH = 32u;             // leaves

// About 64 triangles that are together at rest, with the vertices and edges of no earlier leaf: first and end.
struct SurfaceLeaf {
  uint body, triangles[2], vertices[2], edges[2];
  float offset;  // m, the largest of its vertices
};
// Of all substeps since the last readback.
struct ContactTotals {
  uint touching;   // pairs that acted
  uint truncated;  // vertices stopped on their way
  uint taken;      // momentum that this took, in TAKEN_UNITs of all bodies' mass times 1 m/s
  uint nearest;    // distance of a pair that acted over its offset, a float's bits
  uint most_pairs, most_candidates, most_leaf_pairs;  // found by a detection
};
#define TAKEN_UNIT 1e-9
// Three numbers for an indirect dispatch.
struct WorkGroups {
  uint x, y, z;
};
// Of a detection. Found may be more than there is room for.
struct PairCounts {
  uint leaf_pairs, candidates, pairs;
  WorkGroups leaf_pair_groups, candidate_groups, pair_groups;
};
// Of leaves with consecutive numbers, at a detection. Corners of its box are encoded by ordered.glsl, the others
// are floats' bits.
struct SurfaceBranch {
  uint low[3], high[3];
  uint speed;    // m/s, of its fastest vertex
  uint fastest;  // m/s, that its leaves may meet
};
// A vertex and a triangle, or two edges, that may touch before the next detection.
struct SurfacePair {
  uvec4 vertices;
  uint first, second;  // numbers of both parts, with OF_EDGES
  float offset;        // m
  uint shares;         // of its vertices' masses, in 255ths, a byte each; 0: it does not touch
  vec4 normal;         // where the substep began; m, the distance there
  float push;          // push_apart(); where a side is a rigid body, how large its impulse was
  float impulse[3];    // kg m, with which the next substep begins there
};
// A pair that acts of which a side is a rigid body, in a substep (hard.comp).
struct HardPair {
  uint pair;
  uint bodies[2];     // NONE: soft
  uint acts;          // 0: no more, but it did in the substep before
  vec3 normal;
  float least;        // m, the least way along it that is allowed
  vec4 arms[2];       // m, from the bodies' centres to where they touch
  vec3 soft_way;      // m, of soft sides as they were solved
  float soft_weight;  // 1/kg, of these
  vec3 impulse;       // kg m, so far
  float distance;     // m
  vec3 before;        // the impulse of the last pass, without what it went further
  float offset;       // m
  vec3 more;          // what this pass adds to the impulse
  float friction;
  uint needs;         // 1: in this pass it: has an impulse or needs one
  float restitution;
  uint _0, _1;
};
// With what impulse a pair begins the next substep, for when pairs are found anew (keep.comp).
struct KeptImpulse {
  uint used, first, second;
  float size;
  float impulse[3];
  float _0;
};
// What pairs do to a vertex in a substep, summed by contact/sums.glsl. It moves when none has yet to see where it was.
struct PairSums {
  int stopped[3];  // changes its velocity as well
  int pushed[3];
  int turned[3];   // changes its velocity alone
  uint part;       // of its way, a float's bits
  uint asked[2];   // sum of its pairs' shares, in this substep and the next by turns
  uint pairs;      // that have it
  uint left;       // of these, in this substep
};
#define PAIRED 0x80000000u  // of a vertex's limit: it has pairs
#endif
