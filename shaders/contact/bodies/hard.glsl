// Bodies of pairs that move as rigid ones (method.md, "Hard bodies in contact").
#include "contact/rigid_records.glsl"
// The body of a vertex if it moves so, else NONE.
uint hard_body_of(uint vertex) {
  uint b = body_of(vertex);
  return rigid_bodies[b].hard.moves != 0u ? b : NONE;
}
// From the body's centre to where the vertex was when the substep began, m.
vec3 arm_at_start(uint b, uint vertex, vec3 way) {
  Position x = positions[vertex];
  return arm_of(DoubleSingle(x.high, x.low), rigid_bodies[b].hard.origin) - way - rigid_bodies[b].hard.centre;
}
#define WAY_IN(sums) in_metres(sums[0], sums[1], sums[2])
#define TURN_IN(sums) (in_metres(sums[3], sums[4], sums[5]) / params.body_size)
#define ADD_MOTION(sums, way, turn) \
  { \
    ivec3 moved = to_quanta(way), turned = to_quanta((turn) * params.body_size); \
    for (int c = 0; c < 3; ++c) { \
      if (moved[c] != 0) atomicAdd(sums[c], moved[c]); \
      if (turned[c] != 0) atomicAdd(sums[3 + c], turned[c]); \
    } \
  }
mat3 inverse_inertia_of_body(uint b) {
  return mat3(rigid_bodies[b].hard.inverse_inertia[0].xyz, rigid_bodies[b].hard.inverse_inertia[1].xyz,
              rigid_bodies[b].hard.inverse_inertia[2].xyz);
}
// m, how pairs have changed a vertex's place since the solver moved it; its arm where the substep began or, exactly
// enough, where it ended.
vec3 hard_motion(uint b, vec3 arm) {
  return WAY_IN(rigid_bodies[b].hard.changed) + WAY_IN(rigid_bodies[b].hard.pushed) +
         cross(TURN_IN(rigid_bodies[b].hard.changed) + TURN_IN(rigid_bodies[b].hard.pushed), arm);
}
