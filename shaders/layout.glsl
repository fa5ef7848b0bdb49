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
// A rigid handle (sim/handles.h). S: sum of weight times steps times steps about their mean; matrices as diagonal and (yz, xz, xy).
struct Handle {
  vec3 node;              // cells of its body's lattice
  float weight;           // all its vertices', at most 2^22
  vec3 centre;            // of these, cells
  float steps_per_metre;  // of arms from the centre, at most 2^14 steps
  vec3 cell;              // m, sides of a cell
  uint keeper;            // the patch that writes its pose
  vec3 steps;             // sum of weight times steps
  uint number;            // of the handle; ~0: none
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
  vec3 gravity;           // m/s^2
  float h;                // s, one substep
  float inverse_h;        // 1/s
  float omega;            // over-relaxation of averaged corrections
  float friction;
  float keep;             // velocity kept by damping over a substep, exp(-damping * h)
  float limit;            // m, largest single correction
  float delta_unit;       // m, one unit of a fixed-point sum
  uint vertex_count;
  int plane_count;
  float unit;             // m, one unit of a place: a power of two
  float inverse_unit;     // 1/m
  float position_grain;   // m, the size whose rounding is one unit (constraints/types.glsl)
  float mass_splitting;   // 1: neighbours see n_i w_i, not w_i
  float handles;          // share of the way that rigid handles pull in an iteration
  float _7, _8, _9;
  vec4 stiffness[2];      // by constraint kind
  vec4 planes[MAX_PLANES]; // half spaces n.x >= d as (n, d); the ground is the first if there is one
  vec4 softness[2];        // compliance over h^2, by constraint kind
  vec4 relaxation;         // with compliance, x: constraint damping over h; y: over-relaxation (`omega` is 1 then)
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

// What a dispatch that moves vertices does with them beside the corrections (vertex.glsl); bits.
#define PHASE_PREDICT 1u  // before: v += h g, p = x + h v
#define PHASE_SOLVE 2u    // corrections
#define PHASE_FINISH 4u   // after: v += (p - predicted) / h
#define PHASE_CONTACT 8u  // contacts after the corrections: once an iteration
#define PHASE_FIRST 16u   // the corrections are the first of their substep (compliance only)
#define PHASE_LAST 32u    // and the last
#define PHASE_PLACES 64u  // nothing but sums of handles, from places as they are
#define PHASE_BITS 7      // above them: which group of constraints (mode groups, at most 128)
#define TURN_BITS 14      // above that: a count of dispatches, where there are handles

// Storage bindings of the simulation.
#define BIND_POSITIONS 0
#define BIND_VELOCITIES 1
#define BIND_PREDICTED 2
#define BIND_PLACES 3         // ivec4: what the neighbours of a vertex see of it (places.glsl)
#define BIND_PLACES_OUT 4
#define BIND_CHECK 5          // which vertex is not finite
#define BIND_DELTAS 6         // constraint modes: sums of corrections
#define BIND_PARTS 7          // patches (sim/patches.h)
#define BIND_PATCH_VERTICES 8
#define BIND_PATCH_RECORDS 9
#define BIND_HANDLES 10       // handles (sim/handles.h)
#define BIND_HANDLE_REST 11
#define BIND_HANDLE_SUMS 6
#define BIND_RECORDS 7        // mode paper: + index of the constraint kind among those present
#define STORAGE_BINDINGS 10   // most of any mode
#define BIND_MULTIPLIERS 10   // one more with compliance: of each of the patches' records
#define STORAGE_BINDINGS_HANDLES 12  // with handles, which go without compliance
#define HANDLE_ROW 48         // words of a handle in each set of sums (handles.glsl)
#define BIND_KEEP_FROM 0      // keep.comp
#define BIND_KEEP_TO 2
#define CHECK_STEPS 64        // steps whose checks are under way at most
// Uniform blocks.
#define BIND_STEP 0
// Atomic counters.
#define BIND_GUARDS 0
