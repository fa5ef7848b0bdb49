// Node-centric Jacobi (paper algorithm 2; method.md eqs. 4, 13): $LANES invocations a vertex gather the corrections of all
// constraints on it, of every kind present; one averages, and writes the other buffer. Each constraint is evaluated once by each of its vertices.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = 64) in;
layout(std430, binding = BIND_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_POSITIONS_OUT) writeonly buffer PositionsOut { Position positions_out[]; };
layout(std430, binding = BIND_PREDICTED) readonly buffer Predicted { Position predicted[]; };
layout(std430, binding = BIND_VELOCITIES) readonly buffer Velocities { Velocity velocities[]; };
layout(std430, binding = BIND_ADJACENCY) readonly buffer Adjacency { uint adjacency[]; };
#include "constraints/types.glsl"
#include "contact.glsl"
#include "guards.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "gather.glsl"

#if $LANES > 1
shared vec3 sums[gl_WorkGroupSize.x];
#endif

void main() {
  uint i = gl_GlobalInvocationID.x / $LANESu;
  uint lane = gl_GlobalInvocationID.x % $LANESu;
  bool inside = i < params.vertex_count;
  Position own = positions[inside ? i : 0u];
  vec3 sum = vec3(0.0);
  if (inside && own.inverse_mass > 0.0) {
    #foreach sum += gather_$KIND(i, lane, own);
  }
#if $LANES > 1
  sums[gl_LocalInvocationIndex] = sum;
  barrier();
  for (uint reach = $LANESu / 2u; reach > 0u; reach /= 2u) {
    if (lane < reach) sums[gl_LocalInvocationIndex] += sums[gl_LocalInvocationIndex + reach];
    barrier();
  }
  sum = sums[gl_LocalInvocationIndex];
#endif
  if (!inside || lane != 0u) return;
  if (own.inverse_mass > 0.0) {
    vec3 correction = own.constraints > 0.0 ? sum * (params.omega / own.constraints) : vec3(0.0);
    Pair x = pair_add(Pair(own.high, own.low), correction);
    vec3 moved = params.h * velocities[i].high + (relative(own, predicted[i]) + correction);
    x = resolve_contacts(x, moved);
    own.high = x.high;
    own.low = x.low;
  }
  positions_out[i] = own;
}
