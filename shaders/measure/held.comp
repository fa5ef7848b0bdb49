// Energy of attachments and fibres, now and when velocities were; one work-group for all of them.
#include "types.glsl"
#include "double_single.glsl"
#include "measure/layout.glsl"
layout(local_size_x = METRICS_SIZE) in;
#include "held.glsl"
layout(std430) buffer Row { float row[]; };
uniform float midway;  // s, the age of the positions that velocities belong to
shared vec2 sums[METRICS_SIZE];
void main() {
  uint me = gl_LocalInvocationIndex;
  vec2 sum = vec2(0.0);
  for (uint k = me; k < count; k += METRICS_SIZE) {
    float activation = held[k].is_fibre != 0u ? activation_of(fibres_of(k)) : 0.0;
    sum += vec2(held_energy(k, 0.0, activation), held_energy(k, midway, activation));
  }
  sums[me] = sum;
  barrier();
  for (uint half_size = METRICS_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (me < half_size) sums[me] += sums[me + half_size];
    barrier();
  }
  if (me == 0u) row[M_HELD] = sums[0].x, row[M_HELD_MIDWAY] = sums[0].y;
}
