// Where every vertex will be after prediction (method.md eqs. 1-2), as its neighbours see it: needed once after positions, velocities,
// pins or settings were changed from outside. Otherwise each substep's last dispatch has done it. One thread per vertex.
#include "types.glsl"
#include "pair.glsl"
#include "quantized.glsl"
layout(local_size_x = 256) in;
#include "vertex.glsl"

void main() {
  uint i = group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
  if (i >= params.vertex_count) return;
  Position own = positions[i];
  Pair x = Pair(own.high, own.low);
#if COMPLIANT
  if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(x, 0.0);
#endif
  if (own.inverse_mass > 0.0) x = predict_position(x, predict_velocity(Pair(velocities[i].high, velocities[i].low)));
  quantized_out[i] = quantize(x, weight_of(own));
}
