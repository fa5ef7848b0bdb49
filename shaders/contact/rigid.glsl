// Hard bodies that move as rigid ones (method.md, "Hard bodies are rigid"): what vertices add to the records of their
// bodies at the end of a substep for rigid_contact.comp, and whether a body is moved as a rigid one in this substep.
#include "contact/rigid_records.glsl"
shared int rigid_sums[RIGID_SUMS];

// What vertices read of a body's record.
struct RigidState {
  uint body;
  bool carried;  // moved as a rigid body in this substep
  float slack;
  vec3 origin;
  float mass;
};
RigidState state_of(uint b) {
  uint s = side_now();
  return RigidState(b, rigid_bodies[b].sides[s].carried != 0u, rigid_bodies[b].slack, rigid_bodies[b].sides[s].origin,
                    rigid_bodies[b].mass);
}
RigidState group_state;  // of the body of the work-group's first vertex
RigidState state_at(uint i) {
  uint b = body_of(i);
  if (b == group_state.body) return group_state;
  return state_of(b);
}
// Begins a work-group whose first vertex is i; a barrier must follow.
void begin_sums(uint i) {
  if (gl_LocalInvocationIndex < RIGID_SUMS) rigid_sums[gl_LocalInvocationIndex] = 0;
  group_state = state_of(body_of(min(i, params.vertex_count - 1u)));
}
void add_quanta(uint b, int which, float quanta) {
  if (b == group_state.body) atomicAdd(rigid_sums[which], int(quanta));
  else atomicAdd(rigid_bodies[b].sides[side_now()].sums[which], int(quanta));
}
// In quanta of 2^-30: weights add up to 1, so no sum overflows.
float quanta_of(float value) { return clamp(value, -1.0, 1.0) * 1073741824.0; }
void add_rigid_sum(uint b, int which, float value) { add_quanta(b, which, round(quanta_of(value))); }
// For momenta, which are small compared with RIGID_SPEED: sum `rest` counts parts of a quantum.
void add_rigid_sum(uint b, int which, int rest, float value) {
  float quanta = quanta_of(value), whole = round(quanta);
  add_quanta(b, which, whole);
  add_quanta(b, rest, round((quanta - whole) * RIGID_PARTS));
}
void note_fixed(uint i) { atomicAdd(rigid_bodies[body_of(i)].sides[side_now()].fixed_vertices, 1u); }
void note_range(vec3 value) {
  if (any(greaterThan(abs(value), vec3(1.0)))) atomicAdd(dropped[DROP_RANGE], 1u);
}
// Adds vertex i at x, with velocity v, that will be at `next`, and that constraints have corrected.
void note_motion(RigidState state, uint i, DoubleSingle x, DoubleSingle v, DoubleSingle next, vec3 correction,
                 float inverse_mass) {
  uint b = state.body, s = side_now();
  if (state.slack == 0.0) return;
  if (will_touch(x, next))
    near[s * params.vertex_count + rigid_bodies[b].first + atomicAdd(rigid_bodies[b].sides[s].near, 1u)] = i;
  if (dot(correction, correction) > state.slack * state.slack) rigid_bodies[b].sides[s].deformed = 1u;
  float weight = 1.0 / (inverse_mass * state.mass);
  vec3 place = arm_of(x, state.origin) / (2.0 * params.body_size), arm = clamp(place, vec3(-1.0), vec3(1.0));
  note_range(place);
  for (int a = 0; a < 3; ++a) {
    add_rigid_sum(b, a, weight * arm[a]);
    add_rigid_sum(b, 9 + a, weight * arm[a] * arm[a]);
    add_rigid_sum(b, 12 + a, weight * arm[a] * arm[(a + 1) % 3]);
  }
  if (state.carried) return;  // its momenta are known
  vec3 rate = (v.high + v.low) / RIGID_SPEED, speed = clamp(rate, vec3(-1.0), vec3(1.0));
  vec3 turn = 0.5 * cross(arm, speed);
  note_range(rate);
  for (int a = 0; a < 3; ++a) {
    add_rigid_sum(b, 3 + a, 15 + a, weight * speed[a]);
    add_rigid_sum(b, 6 + a, 18 + a, weight * turn[a]);
  }
}
// Adds the work-group's sums to those of its body.
void end_sums() {
  barrier();
  uint k = gl_LocalInvocationIndex;
  if (k < RIGID_SUMS && rigid_sums[k] != 0)
    atomicAdd(rigid_bodies[group_state.body].sides[side_now()].sums[k], rigid_sums[k]);
}
