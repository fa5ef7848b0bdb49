// Where every vertex will be after prediction (method.md eqs. 1-2), as its neighbours see it: needed once after positions, velocities,
// pins or settings were changed from outside. Otherwise each substep's last dispatch has done it. One thread a vertex.
#include "types.glsl"
#include "pair.glsl"
#include "places.glsl"
layout(local_size_x = 256) in;
#include "vertex.glsl"

void main() {
  uint i = group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
  if (i >= params.vertex_count) return;
  places_out[i] = predicted_place(positions[i], velocities[i]);
#ifdef DAMPED
  places_out[params.vertex_count + i] = place_of(Pair(positions[i].high, positions[i].low), 0.0);
#endif
}
