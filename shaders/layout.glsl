// Buffer layouts and binding numbers, read by GLSL and by C++ (sim/gl/layout.h). Units are SI.
//
// A position is an unevaluated sum high + low of two floats a component (about 48 bits). It keeps the part of a small
// h*v that one float would drop (method.md, "Rounding errors").
struct Position {
  vec3 high;
  float inverse_mass;  // 1/kg; 0: fixed
  vec3 low;
  float constraints;   // n_i, the number of constraints on this vertex
};
struct LedVertex {
  vec3 high;    // of the place that it is led to
  uint vertex;
  vec3 low;
  float speed;  // m/s, at most in this step
};
// What loads vertices, with the factor of a time (loads.comp).
#define LOAD_ACCELERATION 0u
#define LOAD_PRESSURE 1u
#define LOAD_WIND 2u
#define MAX_LOADS 32
struct LoadRecord {
  vec3 vector;   // m/s^2, of wind m/s
  uint kind;
  float amount;  // of pressure Pa, of wind kg/m^3
  float _0, _1, _2;
};
struct Velocity {
  vec3 high;
  float work;  // J that obstacles that move, and loads, have done on the vertex
  vec3 low;
  float _0;
};
// A constraint with its vertices and rest value, for error measures; the solvers have streams or patches.
struct Record2 {
  uint vertices[2];
  float rest;
};
struct Record4 {
  uint vertices[4];
  float rest;
};
struct HeldRecord {
  uint vertices[4];
  float rest[5];
  float stiffness;  // 1 over the compliance
  uint is_fibre;
};
struct TetRecord {
  uint vertices[4];
  float rest, filled;  // m^3; what the body fills of it
  float mu, lambda;    // Pa, of its region, or negative
};
// In place of a TetRecord where any body yields (yield.comp).
struct YieldRecord {
  uint vertices[4];
  float rest, filled;
  float mu, lambda;
  float metric[6];             // 1/m^2, of its shape at rest (yield.glsl)
  float yield_strain;          // 0: it never does
  float creep_time;            // s
  uint first_copy, end_copy;   // of the metric, among those in what the solver reads
};
#define MAX_OBSTACLES 31     // of a step, with the ground; each has a bit of a word in newton/layout.glsl
#define MAX_PLANES 8         // half spaces at rest among them that have no properties of their own
#define MAX_ACTIVATIONS 16   // of fibres, each by keyframes of its own
#define RIGID_SUMS 21
#define RIGID_SPEED 1024.0   // m/s, the fastest velocity that sums can hold
#define RIGID_PARTS 256.0    // parts of a quantum, of which sums over 2^23 vertices do not overflow
#define MOST_TOUCHES 16      // contacts by which a hard body moves
#define LEAST_HEALTH 0.1     // health below which mode newton takes shorter substeps (method.md, "Implicit steps")
#define HEALTH_TURNING 0.05  // health at most where a part of a body turns further than TURN_LIMIT in a substep
#define HEALTH_FAST 0.04     // health at most where a body of some stiffness is about to hit something
#define LOOK_AHEAD 5.0       // steps: notes are read up to four later
#define FAST_STEP 0.004      // of a body's size, by which a fast vertex comes nearer in a step
#define TURN_LIMIT 0.15      // rad
// The constants of a step (a uniform block, std140).
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
  float damping;            // of constraints over h, gamma (with compliance)
  float share;              // with compliance (`omega` is 1 then) 1 over the over-relaxation; 0: leapfrog
  float body_size;          // m, of the largest body at rest
  float restitution;        // of hard bodies
  float drag;               // 1/s, rate at which velocity decays (mode newton)
  float kick;               // factor on accelerations in a substep after longer or shorter ones, of any length
  float turn_limit;         // rad; turning further in a substep lowers the health (mode newton)
  float look_ahead;         // s, in which a stiff body that will hit something lowers it (mode newton)
  vec4 stiffness[3];        // by constraint kind
  vec4 planes[MAX_PLANES];  // half spaces n.x >= d as (n, d); the ground is the first if there is one
  vec4 compliance[3];       // over h^2, by constraint kind
  vec4 activation[MAX_ACTIVATIONS / 4];  // of fibres, by number
};

// An obstacle that is more than a plane, at the end of a substep (a uniform block, std140). Its coordinates have their
// origin at its centre.
struct ObstacleRecord {
  vec3 centre;
  int kind;         // the row of the table of kinds
  vec3 centre_low;  // the low part of `centre`
  float friction;   // its own, or negative
  vec3 right;       // its x axis
  float restitution;  // likewise
  vec3 up;          // y
  float radius;
  vec3 front;       // z
  float spacing;    // m, of a field's points (heights: the least)
  vec3 extent;      // half lengths along its axes
  float trust;      // factor on distances that may be too long (heights), 0 to 1
  vec3 velocity;    // of the centre over the substep
  int first;        // of a field's values
  vec3 spin;        // rad/s
  int convex;       // 1: lies behind the plane at any nearest point
  vec3 origin;      // of a field's points
  int _0;
  ivec3 cells;      // points of a field along each axis
  int _1;
};

// A hard body that moves as a rigid one (contact/rigid.glsl). Momenta and impulses are over the mass of the body.
struct RigidSide {
  int sums[RIGID_SUMS];  // over vertices, fixed-point: mass times arm, velocity, arm x velocity, arm's squares and
                         // products; then what is finer than a quantum of velocity and arm x velocity
  uint near;              // number of vertices that would touch an obstacle in the next substep
  uint fixed_vertices;
  uint carried;           // 1: in this substep the vertices move as a rigid body
  uint touching;          // number of contacts by which it moved
  uint deformed;          // 1: a vertex was corrected by more than `slack`
  uint _0, _1;
  vec3 origin;            // of arms
  uint _2;
  vec3 velocity;          // m/s, of a rigid body, with its low part
  float _3;
  vec3 velocity_low;
  float _4;
  vec3 angular;
  float _5;
  vec3 shift;             // m, of its centre, by pairs after vertices were summed
  float _6;
  vec3 given;             // m, by which the impulses that pairs had in the substep before change its way in the next
  float _7;
  vec3 given_turn;        // m^2, likewise, about its centre
  float _8;
  vec4 impulses[MOST_TOUCHES];
  uint touches[MOST_TOUCHES];  // vertex * MAX_OBSTACLES + obstacle
};
// What pairs of surfaces do to a body that moves as a rigid one, in a substep (contact/bodies/hard.glsl).
struct HardBody {
  uint moves;         // 1: it moves so
  uint pairs;         // that act on it
  uint part;          // of its way that does not cross anything, a float's bits
  float inverse_mass; // 1/kg
  vec3 origin;        // of `centre`
  float _0;
  vec3 centre;        // where the substep began
  float _1;
  vec3 way;           // m, in this substep
  float _2;
  vec3 turn;          // rad
  float _3;
  vec4 inverse_inertia[3];  // 1/(kg m^2)
  int changed[6];     // way and turn by all pairs, fixed-point (contact/sums.glsl); turns times the size of a body
  int pushed[6];      // of its place alone
  int next[6];        // with which it begins the next substep: of its way, and about its centre
  uint sharing[2];    // pairs of a pass that have an impulse or need one, by turns
  vec4 moving;        // m, rad, in a pass
  vec4 turning;
};
struct RigidRecord {
  uint first;      // of its vertices
  uint vertices;
  float slack;     // m, more than constraints correct a vertex by while it keeps its shape; 0: it is never rigid
  float mass;      // kg
  HardBody hard;
  RigidSide sides[2];
};

// Guards of projections where the plain formula has no result or a harmful one (method.md, "Guards"), as bits in the
// order of their counters.
#define GUARD_DIRECTION 1u    // stretch: coincident vertices part along a pseudo-random direction
#define GUARD_HINGE 2u        // bend: a wing on its edge has no angle: skipped
#define GUARD_ANGLE 4u        // bend: the error was clamped to 1 rad
#define GUARD_FLOOR 8u        // volume: the floor under sum w |gradient|^2 took over
#define GUARD_COLLAPSED 16u   // volume: a tet on a line or in a point parts along pseudo-random directions
#define GUARD_LIMIT 32u       // a correction was longer than the body: shortened
#define GUARD_NOT_FINITE 64u  // a correction was not a number: dropped
#define GUARDS 7
// Counters in the block Check of what is dropped where a fixed size or number of sweeps does not suffice.
#define DROP_CONTACTS 0  // a hard body in a substep had more contacts than MOST_TOUCHES
#define DROP_SWEEPS 1    // its impulses had not settled
#define DROP_RANGE 2     // a vertex of it was beyond what sums hold
#define DROP_SPEED 3    // a vertex was too fast for the pairs of surfaces that were listed, and was held up
#define DROPS 4

// The phases of a substep that a dispatch does (a dispatch parameter), as bits.
#define PHASE_PREDICT 1u  // before the corrections: v += h g, p = x + h v
#define PHASE_SOLVE 2u    // corrections, then contacts
#define PHASE_SIDE 8u     // which side of hard bodies' records (contact/rigid.glsl)
#define PHASE_FINISH 4u   // after: v += (p - predicted) / h
#define PHASE_WATCH 16u   // mode explicit: records the stiffness of constraints
#define PHASE_CHANGED 32u // modes explicit and newton: the substeps before were longer or shorter
#define PHASE_NEAR 64u     // bodies may touch

// Binding points of uniform blocks; storage blocks get theirs by name (sim/gl/pass.h).
#define BIND_STEP 0
#define BIND_OBSTACLES 1
// Texture units of the simulation.
#define UNIT_FIELDS 15    // the signed distance fields of all obstacles, one after the other
#define UNIT_LOADS 11     // accelerations beside gravity, by vertex
#define UNIT_LISTED 12    // where vertices were when pairs of surfaces were listed
#define UNIT_QUANTA 13    // how much finer the quanta of each vertex are, where some bodies are far smaller
#define UNIT_SURFACES 14  // friction and restitution of each vertex, where bodies have their own
// Binding points of atomic counters.
#define BIND_GUARDS 0
