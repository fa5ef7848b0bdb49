// Constraint-centric Jacobi, second half (method.md eqs. 13-14): p += omega * (sum of corrections) / n_i, then contacts; clears the sums.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = 256) in;
layout(std430, binding = BIND_POSITIONS) buffer Positions { Position positions[]; };
layout(std430, binding = BIND_PREDICTED) readonly buffer Predicted { Position predicted[]; };
layout(std430, binding = BIND_VELOCITIES) readonly buffer Velocities { Velocity velocities[]; };
layout(std430, binding = BIND_DELTAS) buffer Deltas { ivec4 deltas[]; };
#include "contact.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= params.vertex_count) return;
  Position own = positions[i];
  if (!(own.inverse_mass > 0.0)) return;
  vec3 correction = vec3(deltas[i].xyz) * (params.delta_unit * params.omega);
  deltas[i] = ivec4(0);
  Pair x = pair_add(Pair(own.high, own.low), correction);
  vec3 moved = params.h * velocities[i].high + (relative(own, predicted[i]) + correction);
  x = resolve_contacts(x, moved);
  positions[i].high = x.high;
  positions[i].low = x.low;
}
