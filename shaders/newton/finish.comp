// The last iteration's step, then where each vertex is and how fast (method.md eq. 40). One invocation per vertex.
#include "newton/newton.glsl"
#include "newton/advance.glsl"
vec3 numbers(uint k) { return vec3(sums[k], sums[k + 1u], sums[k + 2u]); }
// What the correction of its body's momentum moves a vertex by.
vec3 rigid_way(uint i, Pair x, vec3 u) {
  uint body = floatBitsToUint(at(REST, i).w);
  if (body == 0u) return vec3(0.0);
  uint k = MOTIONS_AT + MOTION_WORDS * (body - 1u);
  vec3 arm = relative(x, Pair(numbers(k + 7u), numbers(k + 10u))) + u;
  vec3 q = numbers(k + 3u);
  return numbers(k) + 2.0 * cross(q, cross(q, arm) + sums[k + 6u] * arm);  // not the place turned less the place, which rounds
}
void main() {
  Lengths l = Lengths(0.0, 0.0, 0.0, false);
  if (phases > 0u) l = lengths(phases);
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i == 0u && phases > 0u) {
    float first = phases > 1u && sums[FIRST_AT] > 0.0 ? sums[FIRST_AT] : l.rz;
    if (sums[DOTS_AT] > 0.0) atomicMax(largest, floatBitsToUint(first > 0.0 ? sqrt(l.rz / first) : 1.0));
    if (phases == 1u && sums[DOTS_AT] > 0.0) atomicMin(least, floatBitsToUint(l.alpha));
  }
  if (i >= VERTICES) return;
  Position own = positions[i];
  Pair x = Pair(own.high, own.low);
  vec4 offset = at(OFFSET, i);
  vec3 u = vec3(0.0), v = vec3(0.0), before = velocities[i].high + velocities[i].low;
  vec3 way = vec3(0.0), gain = vec3(0.0);
  uint touched = 0u;
  float push = 0.0;
  if (own.inverse_mass > 0.0) {
    uint holds = held_by(at(RESIDUAL, i));
    Advanced last = advanced(i, l);
    vec3 free = start_of(i, x) + last.step;
    u = kept_out(x, free);
    if (phases > 0u && FREE_BODIES > 0u) u += rigid_way(i, x, u);
    bool known = (floatBitsToUint(at(WAY, i).w) & KNOWN) != 0u;
    v = (u - offset.xyz) / offset.w;
    if (!known) v += (0.5 * params.h) * params.gravity;
    for (int k = 0; k < OBSTACLES; ++k) {
      Surface plane = plane_of(k, x, free);
      vec3 n = (holds & (1u << k)) != 0u ? normal_of(uint(k), i) : plane.normal;
      bool clamped = plane.distance < 0.0;
      if ((holds & (1u << k)) != 0u || clamped) {
        float force = -dot(n, last.residual);
        if (force > 0.0 || clamped) touched |= 1u << k;
        push = max(push, force);
      }
    }
#if SHAPES
    vec3 carried = velocity_of(touched, x);
    v = carried + free_part(v - carried, touched, i);
#else
    v = free_part(v, touched, i);
#endif
    way = free_part(u, touched, i);
    gain = free_part(v - before, touched, i);
  }
  x = pair_add(x, u);
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v, 0.0, vec3(0.0), 0.0);
  note_unless_finite(i, x.high, v);
  put(WAY, i, way, uintBitsToFloat(touched | KNOWN));
  put(GAIN, i, gain, push);
}
