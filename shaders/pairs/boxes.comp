// The box around the surface of each body, and the largest speed on it. A work-group per slice.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_VELOCITIES) restrict readonly buffer Velocities { Velocity velocities[]; };
shared vec3 lows[GROUP_SIZE], highs[GROUP_SIZE];
shared float speeds[GROUP_SIZE];
void main() {
  uint lane = gl_LocalInvocationIndex, slice = group_index();
  if (slice >= SLICES) return;
  uint body = pair_mesh[SLICES_AT + 3u * slice], end = pair_mesh[SLICES_AT + 3u * slice + 2u];
  vec3 low = vec3(1e30), high = vec3(-1e30);
  float speed = 0.0;
  for (uint s = pair_mesh[SLICES_AT + 3u * slice + 1u] + lane; s < end; s += GROUP_SIZE) {
    uint i = surface_vertex(s);
    vec3 x = positions[i].high, v = velocities[i].high;
    low = min(low, x), high = max(high, x);
    speed = max(speed, dot(v, v));
  }
  lows[lane] = low, highs[lane] = high, speeds[lane] = speed;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane < half_size) {
      lows[lane] = min(lows[lane], lows[lane + half_size]);
      highs[lane] = max(highs[lane], highs[lane + half_size]);
      speeds[lane] = max(speeds[lane], speeds[lane + half_size]);
    }
    barrier();
  }
  uint k = BOXES + BOX * body;
  if (lane < 3u) {
    atomicMin(pair_lists[k + lane], sortable(lows[0][lane]));
    atomicMax(pair_lists[k + 3u + lane], sortable(highs[0][lane]));
  } else if (lane == 3u) {
    atomicMax(pair_lists[k + 6u], floatBitsToUint(sqrt(speeds[0])));
  }
}
