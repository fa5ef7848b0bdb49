// Moves rigid bodies by what pairs do to them, as far as that takes no surface through another, and gives vertices the
// velocities of their bodies. One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/lists.glsl"
#include "contact/bodies/way.glsl"
#include "contact/sums.glsl"
#include "contact/moved.glsl"
#define SHARED_TOUCHES
#define TOUCHES Touch contacts[1],
#include "contact/impulses.glsl"
#include "contact/bodies/hard.glsl"
#include "contact/bodies/limit.glsl"
layout(std430) restrict buffer HardPairs { uint hard_count; };

// Of the record, for the next substep.
void note_body(uint b, float part) {
  uint s = side_now();
  vec3 changed = WAY_IN(rigid_bodies[b].hard.changed), turned = TURN_IN(rigid_bodies[b].hard.changed);
  float mass = 1.0 / rigid_bodies[b].hard.inverse_mass;
  mat3 inertia = inverse(inverse_inertia_of_body(b) * mass);  // over the mass
  rigid_bodies[b].sides[s].velocity = part * (rigid_bodies[b].sides[s].velocity + changed * params.inverse_h);
  rigid_bodies[b].sides[s].velocity_low *= part;
  rigid_bodies[b].sides[s].angular = part * (rigid_bodies[b].sides[s].angular + inertia * turned * params.inverse_h);
  vec3 way = rigid_bodies[b].hard.way, all = part * (way + changed + WAY_IN(rigid_bodies[b].hard.pushed));
  rigid_bodies[b].sides[s].shift = all - way;
  vec3 given = WAY_IN(rigid_bodies[b].hard.next);
  rigid_bodies[b].sides[s].given = given;
  rigid_bodies[b].sides[s].given_turn =
      TURN_IN(rigid_bodies[b].hard.next) * (params.body_size * params.body_size) - cross(all, given);
  if (part == 1.0) return;
  atomicAdd(totals.truncated, 1u);
  float taken = (1.0 - part) * length(way + changed) * params.inverse_h * mass;
  atomicAdd(totals.taken, uint(min(taken / (TOTAL_MASS * TAKEN_UNIT), 1e9)));
}
void main() {
  uint i = group_index() * GROUP_SIZE + lane();
  if (i >= params.vertex_count) return;
  if (i == 0u) hard_count = 0u;
  uint b = hard_body_of(i);
  if (b == NONE) return;
  float part = uintBitsToFloat(rigid_bodies[b].hard.part);
  Position own = positions[i];
  Velocity speed = velocities[i];
  DoubleSingle x = DoubleSingle(own.high, own.low);
  vec3 way = way_of(i), centre = rigid_bodies[b].hard.centre + rigid_bodies[b].hard.way;
  vec3 arm = arm_of(x, rigid_bodies[b].hard.origin) - centre;
  vec3 changed = WAY_IN(rigid_bodies[b].hard.changed), turned = TURN_IN(rigid_bodies[b].hard.changed);
  vec3 moved = changed + WAY_IN(rigid_bodies[b].hard.pushed) +
               moved_by_turn(half_tangent(turned + TURN_IN(rigid_bodies[b].hard.pushed)), arm);
  vec3 turn = rigid_bodies[b].hard.turn + turned,
       velocity = (rigid_bodies[b].hard.way + changed + cross(turn, arm)) * params.inverse_h;
  moved -= (1.0 - part) * (way + moved);
  vec4 listed = texelFetch(listed_places, int(i));
  listed.w = uintBitsToFloat(floatBitsToUint(listed.w) & ~PAIRED);
  x = add_double(x, listed.w > 0.0 ? within_limit(listed, x, moved) : moved);  // inner vertices have none
  write_moved(i, own, x, DoubleSingle(part * velocity, vec3(0.0)), speed.work);
  if (i == rigid_bodies[b].first && rigid_bodies[b].hard.pairs > 0u) note_body(b, part);
}
