// Hard bodies are rigid (method.md): before a substep a body gets the velocities of a rigid one, in inelastic
// frictional contact if a vertex would get into an obstacle, else in flight if it is not deformed. Each work-group with
// vertices of the body computes its motion anew.
#include "types.glsl"
#include "double_single.glsl"
#if QUANTIZED
#include "quantized.glsl"
#endif
layout(local_size_x = 256) in;
#include "solvers/corrections.glsl"
#define SHARED_TOUCHES shared Touch contacts[MOST_TOUCHES];
#define TOUCHES
#include "contact/impulses.glsl"
shared Rigid before, body;  // the centre from the body's origin; momenta per mass
shared vec3 angular, velocity_low;  // of `before`, then of the motion in flight
shared vec3 turn;                   // in flight (turn_in_flight)
shared vec3 given, given_spin;      // m/s, rad/s, by the pairs of the substep before
shared uint worst, worst_place;
#if MOVING_SOLIDS
shared float worked;  // J, of obstacles that move, on the body in this substep
#endif
shared uint places[MOST_TOUCHES];  // of the contacts: vertex * MAX_OBSTACLES + obstacle

DoubleSingle position_of(uint i) { return DoubleSingle(positions[i].high, positions[i].low); }

// The motion of body b before contact, from its sums on side s.
Rigid rigid_motion(uint b, uint s) {
  float sums[RIGID_SUMS];
  for (int k = 0; k < RIGID_SUMS; ++k) sums[k] = float(rigid_bodies[b].sides[s].sums[k]) / 1073741824.0;
  for (int k = 0; k < 6; ++k) sums[3 + k] += sums[15 + k] / RIGID_PARTS;
  float reach = 2.0 * params.body_size;
  vec3 c = vec3(sums[0], sums[1], sums[2]);
  mat3 moments = mat3(sums[9], sums[12], sums[14], sums[12], sums[10], sums[13], sums[14], sums[13], sums[11]) -
                 outerProduct(c, c);
  Rigid motion;
  motion.unsettled = false;
  motion.centre = reach * c + rigid_bodies[b].sides[s].shift;
  motion.inverse_inertia = inverse_inertia_of(moments * (reach * reach));
  velocity_low = vec3(0.0);
  if (rigid_bodies[b].sides[s].carried != 0u) {  // more exact than sums
    motion.velocity = rigid_bodies[b].sides[s].velocity;
    velocity_low = rigid_bodies[b].sides[s].velocity_low;
    angular = rigid_bodies[b].sides[s].angular;
  } else {
    vec3 speed = vec3(sums[3], sums[4], sums[5]);
    motion.velocity = RIGID_SPEED * speed;
    angular = reach * RIGID_SPEED * (2.0 * vec3(sums[6], sums[7], sums[8]) - cross(c, speed));
  }
  motion.spin = motion.inverse_inertia * angular;
  given = rigid_bodies[b].sides[s].given * params.inverse_h;
  given_spin = motion.inverse_inertia * rigid_bodies[b].sides[s].given_turn * params.inverse_h;
  return motion;
}

// Of a vertex with an obstacle: the signed distance now; the obstacle's velocity there, friction and restitution.
struct Contact {
  vec3 normal;
  float gap;
  vec3 velocity;
  float friction, restitution;
};
Contact contact_with(int k, uint vertex, DoubleSingle x, vec3 arm) {
  vec3 velocity = (velocity_at(before, arm) + params.h * params.gravity) * params.velocity_scale;
  velocity += given + cross(given_spin, arm);
  Surface surface = surface_before(k, x, velocity);
  return Contact(surface.normal, surface.distance, obstacle_velocity(k, x), obstacle_friction(k, vertex),
                 obstacle_restitution(k, vertex));
}
// The least normal velocity that the contact allows.
float least_at(Contact m, vec3 arm) {
  return least_velocity(dot(m.normal, velocity_at(before, arm) - m.velocity), m.gap - closed_gap * params.body_size,
                        params.h, params.h * length(params.gravity), m.restitution);
}
void add_contact(int k, uint place, vec3 origin, vec3 impulse) {
  DoubleSingle x = position_of(place / MAX_OBSTACLES);
  vec3 arm = arm_of(x, origin) - before.centre;
  Contact m = contact_with(int(place % MAX_OBSTACLES), place / MAX_OBSTACLES, x, arm);
  contacts[k] = touch_at(before, m.normal, arm, least_at(m, arm), impulse, m.velocity, m.friction);
  places[k] = place;
}
// Finds the contact of one of `count` vertices that the body's motion violates most, and by more than `loose` (m/s);
// worst_place is ~0 if there is none.
void find_worst(uint b, uint s, uint count, vec3 origin, float loose) {
  uint lane = gl_LocalInvocationIndex;
  if (lane == 0u) {
    worst = 0u;
    worst_place = ~0u;
  }
  barrier();
  float most = loose;
  uint place = ~0u;
  for (uint k = lane; k < count; k += gl_WorkGroupSize.x) {
    uint vertex = near[s * params.vertex_count + rigid_bodies[b].first + k];
    DoubleSingle x = position_of(vertex);
    vec3 arm = arm_of(x, origin) - body.centre, speed = velocity_at(body, arm);
    for (int p = 0; p < obstacle_count(); ++p) {
      Contact m = contact_with(p, vertex, x, arm);
      float over = least_at(m, arm) - dot(m.normal, speed - m.velocity);
      if (over > most || (over == most && vertex * MAX_OBSTACLES + uint(p) < place)) {
        most = over;
        place = vertex * MAX_OBSTACLES + uint(p);
      }
    }
  }
  if (place != ~0u) atomicMax(worst, floatBitsToUint(most));
  barrier();
  if (place != ~0u && floatBitsToUint(most) == worst) atomicMin(worst_place, place);
  barrier();
}
// For the next substep, on side o.
void write_contacts(uint b, uint o, int touching, bool full) {
  uint lane = gl_LocalInvocationIndex;
  if (lane < uint(touching)) {
    rigid_bodies[b].sides[o].touches[lane] = places[lane];
    rigid_bodies[b].sides[o].impulses[lane] = vec4(contacts[lane].impulse, 0.0);
  }
  if (lane == 0u) {
    if (full) atomicAdd(dropped[DROP_CONTACTS], 1u);
    if (body.unsettled) atomicAdd(dropped[DROP_SWEEPS], 1u);
#if MOVING_SOLIDS
    worked = 0.0;
    for (int k = 0; k < touching; ++k)
      worked += rigid_bodies[b].mass * dot(contacts[k].impulse, contacts[k].surface);
#endif
    rigid_bodies[b].sides[o].touching = uint(touching);
    rigid_bodies[b].sides[o].velocity = body.velocity;
    rigid_bodies[b].sides[o].velocity_low = vec3(0.0);
    rigid_bodies[b].sides[o].angular = length(body.spin) > 0.0 ? inverse(body.inverse_inertia) * body.spin : vec3(0.0);
  }
}
// Finds the motion of body b in flight, once `before` is known.
void find_flight(uint b, uint o, bool writes) {
  if (gl_LocalInvocationIndex != 0u) return;
  DoubleSingle pulled = pulled_velocity(DoubleSingle(before.velocity, velocity_low), params.gravity);
  DoubleSingle velocity = add_double(pulled, given);
  body.velocity = velocity.high, velocity_low = velocity.low;
  body.centre = before.centre;
  angular = angular * params.velocity_scale + rigid_bodies[b].sides[1u - o].given_turn * params.inverse_h;
  turn = turn_in_flight(before.inverse_inertia, angular, params.h);
  if (!writes) return;
  rigid_bodies[b].sides[o].touching = 0u;
  rigid_bodies[b].sides[o].velocity = velocity.high;
  rigid_bodies[b].sides[o].velocity_low = velocity.low;
  rigid_bodies[b].sides[o].angular = angular;
#if MOVING_SOLIDS
  worked = 0.0;
#endif
}
// Finds the motion of body b with `count` vertices near obstacles from side s; false if the body has no inertia.
bool find_motion(uint b, uint s, uint count, bool writes) {
  uint lane = gl_LocalInvocationIndex;
  int touching = int(rigid_bodies[b].sides[s].touching);
  vec3 origin = rigid_bodies[b].sides[s].origin;
  float fall = params.h * length(params.gravity), still = 1e-4 * fall;
  if (lane == 0u) before = rigid_motion(b, s);
  barrier();
  if (!has_inertia(before)) return false;
  if (count == 0u) {
    find_flight(b, 1u - s, writes);
    barrier();
    return true;
  }
  if (lane < uint(touching))
    add_contact(int(lane), rigid_bodies[b].sides[s].touches[lane], origin, rigid_bodies[b].sides[s].impulses[lane].xyz);
  Rigid now = before;
  now.velocity = (now.velocity + params.h * params.gravity) * params.velocity_scale;
  now.spin *= params.velocity_scale;
  now.velocity += given, now.spin += given_spin;
  float enough = 2e-7 * length(now.velocity) + 2e-5 * fall, loose = 1e-3 * fall + 4.0 * enough;
  barrier();
  if (lane == 0u) {  // starts from the impulses of the substep before
    for (int k = 0; k < touching; ++k) now = pushed(now, contacts[k].arm, contacts[k].impulse);
    body = settled(now, touching, enough, still);
  }
  bool full = false;
  for (int round = 0;; ++round) {  // adds the worst contact as long as the motion violates any
    find_worst(b, s, count, origin, loose);
    if (worst_place == ~0u) break;
    int at = touching;  // or one without an impulse, to be replaced
    bool known = false;  // contacts contradict each other, as those of a jammed body; more sweeps would not help
    for (int k = touching - 1; k >= 0; --k) {
      if (contacts[k].impulse == vec3(0.0)) at = k;
      known = known || places[k] == worst_place;
    }
    full = !known && (at == MOST_TOUCHES || round == MOST_TOUCHES);
    if (known || full) break;
    touching = max(touching, at + 1);
    barrier();
    if (lane == 0u) {
      add_contact(at, worst_place, origin, vec3(0.0));
      body = settled(body, touching, enough, still);
    }
    barrier();
  }
  if (writes) write_contacts(b, 1u - s, touching, full);
#if MOVING_SOLIDS
  barrier();
#endif
  return true;
}

#if CONTACTS
// What pairs need of body b, whose motion is known.
void write_hard(uint b, uint s, bool moves, uint count) {
  rigid_bodies[b].hard.moves = moves ? 1u : 0u, rigid_bodies[b].hard.pairs = 0u;
  rigid_bodies[b].hard.part = floatBitsToUint(1.0);
  rigid_bodies[b].hard.sharing[0] = rigid_bodies[b].hard.sharing[1] = 0u;
  for (int k = 0; k < 6; ++k)
    rigid_bodies[b].hard.changed[k] = rigid_bodies[b].hard.pushed[k] = rigid_bodies[b].hard.next[k] = 0;
  if (!moves) return;
  rigid_bodies[b].hard.inverse_mass = 1.0 / rigid_bodies[b].mass;
  rigid_bodies[b].hard.origin = rigid_bodies[b].sides[s].origin, rigid_bodies[b].hard.centre = before.centre;
  rigid_bodies[b].hard.way = params.h * body.velocity;
  rigid_bodies[b].hard.turn = params.h * (count == 0u ? before.inverse_inertia * angular : body.spin);
  for (int k = 0; k < 3; ++k)
    rigid_bodies[b].hard.inverse_inertia[k] = vec4(before.inverse_inertia[k] / rigid_bodies[b].mass, 0.0);
}
#endif
void main() {
  uint lane = gl_LocalInvocationIndex, base = group_index() * gl_WorkGroupSize.x, i = base + lane, s = side_now(),
       o = 1u - s;
  if (base >= params.vertex_count) return;
  uint last = body_of(min(base + gl_WorkGroupSize.x, params.vertex_count) - 1u);
  for (uint b = body_of(base); b <= last; ++b) {
    uint first = rigid_bodies[b].first, count = rigid_bodies[b].sides[s].near;
    bool writes = first >= base && first < base + gl_WorkGroupSize.x;
    vec3 origin = rigid_bodies[b].sides[s].origin;
    bool moves = rigid_bodies[b].slack > 0.0 && rigid_bodies[b].sides[s].fixed_vertices == 0u &&
                 (count > 0u || rigid_bodies[b].sides[s].deformed == 0u);
    if (moves) moves = find_motion(b, s, count, writes);
    if (writes) {
      if (lane < RIGID_SUMS) rigid_bodies[b].sides[o].sums[lane] = 0;
      if (lane == 0u) {
        rigid_bodies[b].sides[o].near = rigid_bodies[b].sides[o].deformed = 0u;
        rigid_bodies[b].sides[o].fixed_vertices = 0u;
        rigid_bodies[b].sides[o].carried = moves ? 1u : 0u;
        rigid_bodies[b].sides[o].origin = positions[first].high;
        if (!moves) rigid_bodies[b].sides[o].touching = 0u;
        rigid_bodies[b].sides[o].shift = rigid_bodies[b].sides[o].given = vec3(0.0);
        rigid_bodies[b].sides[o].given_turn = vec3(0.0);
#if CONTACTS
        write_hard(b, s, moves, count);
#endif
      }
    }
    if (moves && i >= first && i < first + rigid_bodies[b].vertices) {
      DoubleSingle x = position_of(i);
      vec3 arm = arm_of(x, origin) - body.centre;
      DoubleSingle v = DoubleSingle(velocity_at(body, arm), vec3(0.0));
      if (count == 0u)
        v = add_double(DoubleSingle(body.velocity, velocity_low), moved_by_turn(turn, arm) * params.inverse_h);
      float work = velocities[i].work;
#if MOVING_SOLIDS
      if (i == first) work += worked;
#endif
      velocities[i] = Velocity(v.high, work, v.low, 0.0);
#if QUANTIZED
      begin_body(i);
      quantized_out[i] = quantize(predict_position(x, v), weight_of(positions[i]));
#endif
    }
    barrier();
  }
}
