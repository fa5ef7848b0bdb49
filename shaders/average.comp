// Second half of constraint-centric Jacobi (method.md eqs. 13-14): p += omega * (sum of corrections) / n_i, then contacts; clears the
// sums. One thread a vertex.
#include "types.glsl"
#include "pair.glsl"
#include "places.glsl"
layout(local_size_x = $GROUP) in;
layout(std430, binding = BIND_DELTAS) buffer Deltas { ivec4 deltas[]; };
#include "vertex.glsl"

void main() {
  uint i = group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
  if (i >= params.vertex_count) return;
  Position own = positions[i];
  Velocity speed;
  if ((turn.x & (PHASE_PREDICT | PHASE_FINISH)) != 0u) speed = velocities[i];
  vec3 correction = vec3(0.0);
  if ((turn.x & PHASE_SOLVE) != 0u) {
    ivec4 sum = deltas[i];
    deltas[i] = ivec4(0);
#if $FLOAT_SUMS
    if (own.constraints > 0.0) correction = intBitsToFloat(sum).xyz * (params.omega / own.constraints);
#else
    correction = vec3(sum.xyz) * (params.delta_unit * params.omega);
#endif
  }
  advance(i, own, speed, correction);
}
