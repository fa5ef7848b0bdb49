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

// Storage bindings of the simulation.
#define BIND_POSITIONS 0      // the current ones; a double-buffered solver reads these
#define BIND_POSITIONS_OUT 1  // ... and writes these
#define BIND_PREDICTED 2
#define BIND_VELOCITIES 3
#define BIND_ADJACENCY 4
#define BIND_DELTAS 4         // constraint mode (has no adjacency)
#define BIND_RECORDS 5        // + index of the constraint kind among those present
// Uniform blocks.
#define BIND_STEP 0
