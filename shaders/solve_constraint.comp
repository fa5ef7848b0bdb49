// Constraint-centric Jacobi (paper algorithm 3; method.md eqs. 4, 14): one thread a constraint adds its corrections to its vertices' sums.
// Sums are integers, so their order does not matter and the result is the same bits every time. A unit is params.delta_unit
// times the vertex's number of constraints, and no correction exceeds params.limit = 2^30 units over that number: a sum cannot overflow.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = 256) in;
layout(std430, binding = BIND_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_DELTAS) buffer Deltas { int deltas[]; };
layout(std430, binding = $BINDING) readonly buffer Records { Record$ARITY records[]; };
uniform uint count;
#include "constraints/types.glsl"
#include "guards.glsl"
#include "constraints/$KIND.glsl"

void main() {
  uint index = gl_GlobalInvocationID.x;
  if (index >= count) return;
  Record$ARITY record = records[index];
  Position p[$ARITY];
  vec3 x[$ARITY];
  float w[$ARITY];
  for (int j = 0; j < $ARITY; ++j) {
    p[j] = positions[record.vertices[j]];
    x[j] = relative(p[j], p[0]);
    w[j] = p[j].inverse_mass;
  }
  Constraint$ARITY c = $KIND(x, record.rest, record.vertices);
  float lambda = params.stiffness[$KIND_ROW][$KIND_COLUMN] * multiplier(c, w);
  uint guards = guards_of(c, w);
  for (int j = 0; j < $ARITY; ++j) {
    vec3 correction = lambda * w[j] * c.gradient[j];
    guards |= guards_of(correction, params.limit);
    correction = limited(correction, params.limit);
    ivec3 units = ivec3(round(correction / (params.delta_unit * p[j].constraints)));
    for (int a = 0; a < 3; ++a)
      if (units[a] != 0) atomicAdd(deltas[4u * record.vertices[j] + uint(a)], units[a]);
  }
  count_guards(guards);
}
