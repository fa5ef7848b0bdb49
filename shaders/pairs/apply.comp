// Moves the vertices that contacts push, and what their neighbours see of them. One invocation per vertex of a surface.
#include "pairs/pairs.glsl"
#if IMPLICIT
#include "vertex_state.glsl"
#include "newton/vectors.glsl"
#else
#include "quantized.glsl"
#include "vertex.glsl"
#endif
void main() {
  uint s = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (s >= SURFACE_VERTICES) return;
  uint i = surface_vertex(s);
  if (pair_sums[8u * i + 3u] == 0) return;
  vec3 stopped, pushed;
  for (uint c = 0u; c < 3u; ++c) {
    stopped[c] = float(pair_sums[8u * i + c]) * (params.quantum / PARTS);
    pushed[c] = float(pair_sums[8u * i + 4u + c]) * (params.quantum / PARTS);
  }
  for (uint c = 0u; c < 8u; ++c) pair_sums[8u * i + c] = 0;
  Position own = positions[i];
  if (!(own.inverse_mass > 0.0)) return;
  Pair x = pair_add(Pair(own.high, own.low), stopped + pushed), v = Pair(velocities[i].high, velocities[i].low);
  v = pair_add(v, stopped * params.inverse_h);
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
#if IMPLICIT
  vec4 way = at(WAY, i);
  put(WAY, i, way.xyz + stopped, way.w);  // the history of BDF2 has what velocity has, and so keeps momentum
#else
#if !LEAPFROG
  x = predict_position(x, predict_velocity(v));
#endif
  quantized_out[i] = quantize(x, weight_of(own));
#endif
}
