// What the buffers of mode newton are made of, read by GLSL and by C++ (sim/solvers/newton_buffers.h). Units are SI.

// Vectors by vertex, VERTICES of each slot: x, y and z are the vector, and w is what stands behind the semicolon.
const uint AIM = 0u;           // displacement that inertia asks for; mass / h^2 (0: fixed)
const uint OFFSET = 1u;        // displacement to z of BDF2; h
const uint DISPLACEMENT = 2u;  // of the last step; bits: a step is known, obstacles touched
const uint GAIN = 3u;          // of velocity in the last step; the force of obstacles, N
const uint RESIDUAL = 4u;      // r
const uint SEARCH = 5u;        // z = M^-1 r
const uint DIRECTION = 6u;     // p; this and the next two: slip_direction
const uint IMAGE = 7u;         // q = A p
const uint STEP = 8u;          // s, of Newton
const uint INVERSE = 9u;       // of A's 3x3 block: xx, yy, zz; resistance to sliding, N/m
const uint INVERSE2 = 10u;     // xy, xz, yz; bits of the obstacles on which it slides
const uint PRODUCT = 11u;      // A z
const uint REST = 12u;         // position; bits: the number of the body
const uint FRICTION = 13u;     // by obstacles, N; bits of what holds the vertex
const uint START = 14u;        // Newton's furthest start, where bodies start rigidly; 1: of a stiff body that is held
const uint LEFT = 15u;         // of friction by the last step, N; 1: the vertex slipped
// Sums of fixed-point integers over the pairs of surfaces that act on a vertex (pressed.glsl).
const uint PRESS = 16u;      // force, N, or a product with the pairs' part of the matrix, in high quanta
const uint PRESS_LOW = 17u;  // what is left of that, in low ones
const uint BLOCK = 18u;      // the pairs' part of A's 3x3 block: xx, yy, zz
const uint BLOCK2 = 19u;     // xy, xz, yz
const uint HELD = 20u;       // what of BLOCK comes from surfaces that are fixed
const uint HELD2 = 21u;      // likewise of BLOCK2
const uint MOVED = 22u;      // displacement, for press.comp
// N/m, the body's own part of A's 3x3 block in the last substep.
const uint OWN = 23u;        // xx, yy, zz; m, how far pairs press it
const uint OWN2 = 24u;       // xy, xz, yz; m, how far they pressed it in the substep before
const uint SLOTS = 25u;
const uint KNOWN = 0x80000000u;

// An edge of the matrix: the columns of the block in its first vertex's row and second one's column. Their w are the
// force on the first vertex, which is opposite on the second.
struct EdgeBlock {
  vec4 columns[3];
};
// Bodies are solved apart: each has its own step lengths, start and coarse level.
struct BodyRange {
  uint first, end;    // of its vertices
  uint first_group;   // of product.comp
  uint tets;          // for which Newton's start is checked
  uint first_aggregate, end_aggregate;
  uint coarse_at, coarse_row;  // where its coarse inverse begins, and the length of a row, in vec4s
  float mass;                  // kg
};
// An edge's use of a constraint, whose vertices i and j it joins; kinds are counted among those present.
#define PACKED_USE(constraint, kind, i, j) ((constraint) << 7 | (kind) << 4 | (i) << 2 | (j))
#define USE_CONSTRAINT(use) ((use) >> 7)
#define USE_KIND(use) ((use) >> 4 & 7u)
#define USE_I(use) int((use) >> 2 & 3u)
#define USE_J(use) int((use) & 3u)
#define MOST_CONSTRAINTS (1u << 25)  // of a kind
// Stiffness over mass, in 1/h^2, above which a body starts as a rigid one, and takes steps of implicit Euler while it
// touches something: sound crosses it within a few substeps, which BDF2 does not follow.
#define STIFF_BODY 0.05
#define AGAIN 65536u  // with an iteration: it is of a second round, which linearises where the first has ended
#define TOGETHER 131072u  // with an iteration: bodies that may touch are solved as one system
// A vertex's share of an aggregate.
#define PACKED_SHARE(aggregate, weight) ((aggregate) << 16 | (weight))
#define SHARE_AGGREGATE(share) ((share) >> 16)
#define SHARE_WEIGHT(share) ((share) & 65535u)
#define WEIGHT_UNIT (1.0 / 65535.0)

// What an iteration of conjugate gradients leaves to a body's next.
struct Iteration {
  float rz;  // r . z
  float alpha;
  uint coarse;  // 1: the coarse level takes part
};
// The rigid motion that takes back momentum that nothing gave a free body (method.md eq. 39).
struct BodyMotion {
  vec4 turn;  // a quaternion
  vec3 displacement;
  float load;  // what obstacles bear of the body over what its vertices push
  vec3 centre_high;
  float held;  // 1: an obstacle pushes the body
  vec3 centre_low;
  float whole;  // 1: before Newton starts, the whole motion of a body that starts as a rigid one
};
// How a free body that obstacles hold and rub against answers a force as a rigid one: 6x6, by rows, about an origin.
struct BodyResponse {
  float inverse[36];
  vec4 arm;  // from there to the centre of mass
};
// Sums over the vertices of a free body, by column: the excess force, and mass; its moment, and how many are fixed; the
// first moments of mass; 21 numbers of the upper half of a 6x6 matrix, by rows; the force that obstacles push with, as
// far as the residual says, and what inertia asks for.
#define MATRIX_AT 11u  // in floats, of what all columns hold
#define PUSH_AT 32u
#define NEED_AT 35u
#define MOMENTUM_COLUMNS 10
struct MomentumSums {
  vec4 columns[MOMENTUM_COLUMNS];
};
