// What neighbours see of every vertex: where prediction will put it (method.md eqs. 1-2), in mode explicit where it is.
// Needed after positions, velocities, pins or settings were changed from outside; otherwise the last dispatch of each
// substep has done it. One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
#if QUANTIZED
#include "quantized.glsl"
#endif
layout(local_size_x = 256) in;
#include "solvers/$SCHEME.glsl"

void predict(uint i) {
  begin_body(i);
  Position own = positions[i];
  DoubleSingle x = DoubleSingle(own.high, own.low), here = x, v = DoubleSingle(velocities[i].high, velocities[i].low);
  if (own.inverse_mass > 0.0) x = seen_by_neighbours(i, x, v);
#if COMPLIANT && QUANTIZED
  if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(place_before(here, v), 0.0);
#endif
#if RIGID_CONTACT
  RigidState body = state_at(i);
  body.origin = positions[rigid_bodies[body.body].first].high;
  if (own.inverse_mass > 0.0) note_motion(body, i, here, v, x, vec3(0.0), own.inverse_mass);
  else note_fixed(i);
  if (i == rigid_bodies[body.body].first) rigid_bodies[body.body].sides[side_now()].origin = body.origin;
#endif
#if QUANTIZED
  quantized_out[i] = quantize(x, weight_of(own));
#endif
}

void main() {
  uint i = group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
#if RIGID_CONTACT
  begin_sums(i - gl_LocalInvocationIndex);
  barrier();
#endif
  if (i < params.vertex_count) predict(i);
#if RIGID_CONTACT
  end_sums();
#endif
}
