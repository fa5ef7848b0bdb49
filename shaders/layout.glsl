// Buffer layouts and binding numbers, read by GLSL and by C++ (sim/layout.h). Units are SI.
//
// A position is an unevaluated sum high + low of two floats a component (about 48 bits): what one float would drop of
// a small h*v is kept (method.md, "What float drops").
struct Position {
  vec3 high;
  float inverse_mass;  // 1/kg; 0: fixed
  vec3 low;
  float constraints;   // n_i, the number of constraints on this vertex
};
struct Velocity {
  vec3 high;
  float _0;
  vec3 low;
  float _1;
};
// A constraint: its vertices and rest value (error measures; the solvers have streams or patches).
struct Record2 {
  uint vertices[2];
  float rest;
};
struct Record4 {
  uint vertices[4];
  float rest;
};
// A shape-matching cluster (sim/solvers/clusters.h). S: sum of weight times steps times steps about their mean; matrices as diagonal and (yz, xz, xy).
struct Cluster {
  vec3 node;              // cells of its body's lattice
  float weight;           // all its vertices', at most 2^22
  vec3 centre;            // of these, cells
  float steps_per_metre;  // of arms from the centre, at most 2^14 steps
  vec3 cell;              // m, sides of a cell
  uint owner;             // the patch that writes its pose
  vec3 steps;             // sum of weight times steps
  uint number;            // of the cluster; ~0: none
  vec3 squares;           // S
  float _3;
  vec3 products;
  float _4;
  vec3 inverse_squares;   // (tr S - S)^-1
  float _5;
  vec3 inverse_products;
  float _6;
};

#define MAX_PLANES 8
// Everything of a step that does not change within it (a uniform block, std140).
struct Step {
  vec3 gravity;             // m/s^2
  float h;                  // s, one substep
  float inverse_h;          // 1/s
  float omega;              // over-relaxation of averaged corrections
  float friction;
  float velocity_scale;     // left by damping over a substep, exp(-damping * h)
  float max_correction;     // m, largest single correction
  float correction_quantum; // m, of fixed-point sums
  uint vertex_count;
  int plane_count;
  float quantum;            // m, of quantized positions: a power of two
  float inverse_quantum;    // 1/m
  float quantized_size;     // m, the size whose rounding is one quantum (constraints/types.glsl)
  float mass_splitting;     // 1: neighbours see n_i w_i, not w_i
  float cluster_strength;   // share of the way that clusters pull in an iteration
  float damping;            // of constraints over h, gamma (with compliance)
  float soft_omega;         // over-relaxation with compliance (`omega` is 1 then)
  float _0;
  vec4 stiffness[2];        // by constraint kind
  vec4 planes[MAX_PLANES];  // half spaces n.x >= d as (n, d); the ground is the first if there is one
  vec4 compliance[2];       // over h^2, by constraint kind
};

// Guards: what a projection does where the plain formula has no answer or a harmful one (method.md, "Guards"). Bits, in the order
// of their counters.
#define GUARD_DIRECTION 1u    // stretch: coincident vertices part along a pseudo-random direction
#define GUARD_HINGE 2u        // bend: a wing on its edge has no angle: skipped
#define GUARD_ANGLE 4u        // bend: the error was clamped to 1 rad
#define GUARD_FLOOR 8u        // volume: the floor under sum w |gradient|^2 took over
#define GUARD_COLLAPSED 16u   // volume: a tet on a line or in a point parts along pseudo-random directions
#define GUARD_LIMIT 32u       // a correction was longer than the body: shortened
#define GUARD_NOT_FINITE 64u  // a correction was not a number: dropped
#define GUARDS 7

// What a dispatch does (a dispatch parameter); bits.
#define PHASE_PREDICT 1u  // before the corrections: v += h g, p = x + h v
#define PHASE_SOLVE 2u    // corrections, then contacts
#define PHASE_FINISH 4u   // after: v += (p - predicted) / h
#define PHASE_SUMS 8u     // nothing but the clusters' sums, of positions as they are

// Storage bindings of the simulation; a kernel has 8 at most, but for those with clusters.
#define BIND_POSITIONS 0
#define BIND_VELOCITIES 1
#define BIND_PREDICTED 2
#define BIND_QUANTIZED 3      // what the neighbours of a vertex see of it (quantized.glsl)
#define BIND_QUANTIZED_OUT 4
#define BIND_CHECK 5          // the first state that is not finite
#define BIND_PATCHES 6        // sim/solvers/patches.h
#define BIND_MULTIPLIERS 7    // with compliance, of each of the patches' records
#define BIND_SUMS 8           // constraint modes: sums of corrections
#define BIND_RECORDS 9        // mode paper: of one constraint kind
#define BIND_CLUSTERS 10      // sim/solvers/clusters.h
#define BIND_CLUSTER_REST 11
#define BIND_CLUSTER_SUMS 12
#define BIND_CHECKPOINT_FROM 13
#define BIND_CHECKPOINT_TO 14
#define CLUSTER_ROW 48        // words of a cluster in each set of sums (clusters.glsl)
// Uniform blocks.
#define BIND_STEP 0
// Atomic counters.
#define BIND_GUARDS 0
