// What the buffers of mode newton are made of, read by GLSL and by C++ (sim/solvers/newton_buffers.h). Units are SI.

// Vectors by vertex, VERTICES of each slot: x, y and z are the vector, and w is what stands behind the semicolon.
const uint AIM = 0u;           // displacement that inertia asks for; mass / h^2 (0: fixed)
const uint OFFSET = 1u;        // displacement to z of BDF2; h
const uint DISPLACEMENT = 2u;  // of the last step; bits: a step is known, obstacles touched
const uint GAIN = 3u;          // of velocity in the last step; the force of obstacles, N
const uint RESIDUAL = 4u;      // r; bits of obstacles that hold the vertex
const uint SEARCH = 5u;        // z = M^-1 r
const uint DIRECTION = 6u;     // p
const uint IMAGE = 7u;         // q = A p
const uint STEP = 8u;          // s, of Newton
const uint INVERSE = 9u;       // of A's 3x3 block: xx, yy, zz; resistance to sliding, N/m
const uint INVERSE2 = 10u;     // xy, xz, yz; bits of the obstacles on which it slides
const uint PRODUCT = 11u;      // A z
const uint REST = 12u;         // position; bits: 1 + number among free bodies, or 0
const uint SLOTS = 13u;
const uint KNOWN = 0x80000000u;

// An edge of the matrix: the columns of the block in its first vertex's row and second one's column. Their w are the
// force on the first vertex, which is opposite on the second.
struct EdgeBlock {
  vec4 columns[3];
};
struct FreeBody {
  uint first, end;  // of its vertices
};
// An edge's use of a constraint, whose vertices i and j it joins; kinds are counted among those present.
#define PACKED_USE(constraint, kind, i, j) ((constraint) << 7 | (kind) << 4 | (i) << 2 | (j))
#define USE_CONSTRAINT(use) ((use) >> 7)
#define USE_KIND(use) ((use) >> 4 & 7u)
#define USE_I(use) int((use) >> 2 & 3u)
#define USE_J(use) int((use) & 3u)
#define MOST_CONSTRAINTS (1u << 25)  // of a kind
// A vertex's share of an aggregate.
#define PACKED_SHARE(aggregate, weight) ((aggregate) << 16 | (weight))
#define SHARE_AGGREGATE(share) ((share) >> 16)
#define SHARE_WEIGHT(share) ((share) & 65535u)
#define WEIGHT_UNIT (1.0 / 65535.0)

// What an iteration of conjugate gradients leaves to the next.
struct Iteration {
  float rz;  // r . z
  float alpha;
  uint coarse;  // 1: the coarse level takes part
};
// The rigid motion that takes back momentum that nothing gave a free body (method.md eq. 43).
struct BodyMotion {
  vec4 turn;  // a quaternion
  vec3 displacement;
  float _0;
  vec3 centre_high;
  float _1;
  vec3 centre_low;
  float _2;
};
// Sums over the vertices of a free body, by column: the excess force, and mass; its moment, and how many are held; the
// first moments of mass; the second ones, squares and then products.
#define MOMENTUM_COLUMNS 5
struct MomentumSums {
  vec4 columns[MOMENTUM_COLUMNS];
};
