// Ends the last iteration and the step: the position and velocity of each vertex (method.md eq. 35). One invocation per
// vertex.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
#if TOUCHING
#include "contact/bodies/limit.glsl"
// How much of its way a vertex goes that has no pair, so that it stays where pairs were listed for.
float listed_part(uint i, DoubleSingle x, vec3 u) {
  vec4 listed = texelFetch(listed_places, int(i));
  if ((phases & TOGETHER) == 0u || floatBitsToInt(listed.w) <= 0) return 1.0;
  float whole = length(u);
  return whole > 0.0 ? length(within_limit(listed, x, u)) / whole : 1.0;
}
#endif
#if MOVING_SOLIDS
// W, of the obstacles that move: what holds the vertex, what pushed it out at the end, and friction, along their
// velocities.
float work_rate(uint i, DoubleSingle x, vec3 free, vec3 u, uint holds, vec3 residual) {
  uint touched = floatBitsToUint(at(INVERSE2, i).w);
  vec3 pushed_out = at(AIM, i).w * (u - free);
  float rate = 0.0;
  for (int k = 0; k < obstacle_count(); ++k) {
    vec3 velocity = obstacle_velocity(k, x);
    Surface plane = surface_ahead(k, x, free, free);
    if ((holds & (1u << k)) != 0u) {
      vec3 n = normal_of(k, i);
      rate -= dot(n, residual) * dot(n, velocity);
    }
    if (plane.distance < 0.0) rate += dot(pushed_out, plane.normal) * dot(plane.normal, velocity);
  }
  if (touched != 0u) {
    vec3 velocity = obstacle_velocity(findLSB(touched), x);
    rate += dot(friction_force(at(FRICTION, i).xyz, i, x, u, touched, at(INVERSE, i).w), velocity);
  }
  return rate;
}
#endif
// A body that sound crosses within a few steps hits something at speed: short substeps alone can follow that, and are
// to begin before it does.
void note_fast(uint i, DoubleSingle x, vec3 v) {
  float step_length = params.look_ahead / LOOK_AHEAD;
  bool stiff = bodies[body_of(i)].w * step_length * step_length > STIFF_BODY;
  if (!stiff) return;
  float fast = FINE(FAST_STEP * params.body_size) / step_length + 4.0 * step_length * length(params.gravity);
  for (int k = 0; k < obstacle_count(); ++k) {
    vec3 nearing = v - obstacle_velocity(k, x), way = params.look_ahead * nearing;
    Surface met = surface_ahead(k, x, way, way);
    if (met.distance < 0.0 && -dot(met.normal, nearing) > fast) atomicMin(least, floatBitsToUint(HEALTH_FAST));
  }
}
// A body's health, and what the iterations leave of the residual. One that starts as a rigid body starts so near to
// where it will be that rounding and contact may leave more than there was.
void note_convergence(uint body) {
  Lengths l = lengths(iteration(), body);
  float first = first_rz[body] > 0.0 ? first_rz[body] : l.rz;
  float left = first > 0.0 ? sqrt(l.rz / first) : 1.0;
  if (dots[body].x > 0.0 && !is_stiff(body)) atomicMax(largest, floatBitsToUint(left));
  if (iteration() == 1u && dots[body].x > 0.0) atomicMin(least, floatBitsToUint(l.alpha));
}
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i < BODIES && iteration() > 0u) note_convergence(i);
  if (i >= VERTICES) return;
  uint body = body_of(i);
  Lengths l = Lengths(0.0, 0.0, 0.0, false);
  if (iteration() > 0u) l = lengths(iteration(), body);
  Position own = positions[i];
  DoubleSingle x = DoubleSingle(own.high, own.low);
  vec4 offset = at(OFFSET, i);
  vec3 u = vec3(0.0), before = velocities[i].high + velocities[i].low, v = before;
  vec3 displacement = vec3(0.0), gain = vec3(0.0), friction = vec3(0.0);
  uint touched = 0u;
  bool slips = false;
  float push = 0.0, work = velocities[i].work;
  if (own.inverse_mass > 0.0) {
    uint holds = held_by(i);
    Advanced last = Advanced(vec3(0.0), vec3(0.0), vec3(0.0), at(RESIDUAL, i).xyz);  // of no iteration
    if (iteration() > 0u) last = advanced(i, l);
    vec3 free = start_displacement(i, x) + last.step;
    u = kept_out(x, free);
    float load = 1.0;
    bool falls = !is_step_known(i);  // an explicit start of BDF2, of what nothing holds
    if (iteration() > 0u && FREE_BODIES > 0u) {
      u = free + free_part(rigid_displacement(i, x, free), holds, i);
      u = kept_out(x, u);
      load = motions[body].load, falls = falls && motions[body].held == 0.0;
    }
#if TOUCHING
    u *= listed_part(i, x, u);
#endif
    v = (u - offset.xyz) / offset.w;
    if (falls) v += (0.5 * params.h) * pull_on(i);
    for (int k = 0; k < obstacle_count(); ++k) {
      Surface plane = surface_ahead(k, x, free, free);
      bool held = (holds & (1u << k)) != 0u, clamped = plane.distance < 0.0;
      vec3 n = held ? normal_of(k, i) : plane.normal;
      if (held || clamped) {
        float force = -dot(n, last.residual);
        if (force > 0.0 || clamped) touched |= 1u << k;
        push = max(push, load * force);
      }
    }
    uint slid_on = floatBitsToUint(at(INVERSE2, i).w);
    float slides = at(INVERSE, i).w;
    bool rubs = friction_limit(i, slid_on) > 0.0;
    slips = rubs && slides < 0.99 * grip * at(AIM, i).w;
    if (rubs && touched != 0u) {
      vec3 left = free_part(at(FRICTION, i).xyz, slid_on, i);
      friction = mix(left, friction_force(at(FRICTION, i).xyz, i, x, u, slid_on, slides), slips ? 1.0 : kept_grip);
      friction *= min(1.0, obstacle_friction(findLSB(touched), i) * push / max(length(friction), 1e-30));
    }
#if MOVING_SOLIDS
    work += params.h * work_rate(i, x, free, u, holds, last.residual);
#endif
#if LOADED
    work += work_of_loads_midway(i, u, own.inverse_mass);
#endif
    vec3 carried = obstacle_velocity(findLSB(touched), x);  // by the first obstacle that it touches
    uint stops = began_stiff(i) ? 0u : touched;
    vec3 stopped = carried + free_part(v - carried, stops, i);
#if MOVING_SOLIDS
    work += dot(stopped - v, carried) / own.inverse_mass;
#endif
    v = stopped;
    displacement = params.h * carried + free_part(u - params.h * carried, stops, i);
    gain = free_part(v - before, stops, i);
  }
  x = add_double(x, u);
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v, work, vec3(0.0), 0.0);
  note_unless_finite(i, x.high, v);
#if RIGID_START
  note_fast(i, x, v);
#endif
  // Contact of bodies asks for the way, of a pinned one where it was led.
  put(OFFSET, i, own.inverse_mass > 0.0 ? u : params.h * v, offset.w);
  put(DISPLACEMENT, i, displacement, uintBitsToFloat(touched | KNOWN));
  put(GAIN, i, gain, push);
  put(LEFT, i, friction, slips ? 1.0 : 0.0);
}
