// Ends the last iteration and the step: the position and velocity of each vertex (method.md eq. 40). One invocation per
// vertex.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
// The displacement by which correcting its body's momentum moves a vertex.
vec3 rigid_displacement(uint i, DoubleSingle x, vec3 u) {
  uint body = floatBitsToUint(at(REST, i).w);
  if (body == 0u) return vec3(0.0);
  BodyMotion m = motions[body - 1u];
  vec3 arm = relative(x, DoubleSingle(m.centre_high, m.centre_low)) + u;
  vec3 q = m.turn.xyz;
  // Not the turned arm less the arm, a difference that would drop digits.
  return m.displacement + 2.0 * cross(q, cross(q, arm) + m.turn.w * arm);
}
void main() {
  Lengths l = Lengths(0.0, 0.0, 0.0, false);
  if (phases > 0u) l = lengths(phases);
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i == 0u && phases > 0u) {
    float first = phases > 1u && first_rz > 0.0 ? first_rz : l.rz;
    if (dots.x > 0.0) atomicMax(largest, floatBitsToUint(first > 0.0 ? sqrt(l.rz / first) : 1.0));
    if (phases == 1u && dots.x > 0.0) atomicMin(least, floatBitsToUint(l.alpha));
  }
  if (i >= VERTICES) return;
  Position own = positions[i];
  DoubleSingle x = DoubleSingle(own.high, own.low);
  vec4 offset = at(OFFSET, i);
  vec3 u = vec3(0.0), v = vec3(0.0), before = velocities[i].high + velocities[i].low;
  vec3 displacement = vec3(0.0), gain = vec3(0.0);
  uint touched = 0u;
  float push = 0.0;
  if (own.inverse_mass > 0.0) {
    uint holds = held_by(at(RESIDUAL, i));
    Advanced last = advanced(i, l);
    vec3 free = start_displacement(i, x) + last.step;
    u = kept_out(x, free);
    if (phases > 0u && FREE_BODIES > 0u) u += rigid_displacement(i, x, u);
    v = (u - offset.xyz) / offset.w;
    if (!is_step_known(i)) v += (0.5 * params.h) * params.gravity;
    for (int k = 0; k < obstacle_count(); ++k) {
      Surface plane = surface_ahead(k, x, free, free);
      bool held = (holds & (1u << k)) != 0u, clamped = plane.distance < 0.0;
      vec3 n = held ? normal_of(k, i) : plane.normal;
      if (held || clamped) {
        float force = -dot(n, last.residual);
        if (force > 0.0 || clamped) touched |= 1u << k;
        push = max(push, force);
      }
    }
    vec3 carried = obstacle_velocity(findLSB(touched), x);  // by the first obstacle that it touches
    v = carried + free_part(v - carried, touched, i);
    displacement = free_part(u, touched, i);
    gain = free_part(v - before, touched, i);
  }
  x = add_double(x, u);
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v, 0.0, vec3(0.0), 0.0);
  note_unless_finite(i, x.high, v);
  put(DISPLACEMENT, i, displacement, uintBitsToFloat(touched | KNOWN));
  put(GAIN, i, gain, push);
}
