// Begins an iteration: step lengths, the vectors of each vertex, the coarse residual; iteration 0 begins at Newton's
// start. A work-group per aggregate, then an invocation per vertex.
#define COLUMNS 2
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"

// The coarse residual of the vectors in `slot`, by the aggregate's rotated rigid motions. It is 0 for an aggregate that
// an obstacle holds, which cannot move as a whole, as the coarse matrix does not know.
void restrict_to(uint aggregate, uint slot, Lengths l) {
  uint lane = gl_LocalInvocationIndex, end = first_member[aggregate + 1u];
  vec4 centre = centres[aggregate], back = opposite(rotations[aggregate]);
  vec3 force = vec3(0.0), torque = vec3(0.0);
  float holds = 0.0;
  for (uint k = first_member[aggregate] + lane; k < end; k += GROUP_SIZE) {
    uint i = members[k].x;
    uint held = held_by(i);
    float weight = float(members[k].y) * WEIGHT_UNIT;
    vec3 f = weight * turned(back, free_part(at(slot, i).xyz, held, i));
    if (held != 0u) holds = 1.0;
#if TOUCHING
    if (at(BLOCK, i).xyz != vec3(0.0)) holds = 1.0;
#endif
    force += f;
    torque += cross((at(REST, i).xyz - centre.xyz) / centre.w, f);
  }
  columns[0][lane] = vec4(force, holds);
  columns[1][lane] = vec4(torque, 0.0);
  add_up_columns();
  if (lane >= 6u) return;
  bool held = slot == RESIDUAL ? columns[0][0].w > 0.0 && RIGID_START == 0u : is_free[aggregate] == 0.0;
  float value = held ? 0.0 : columns[lane / 3u][0][lane % 3u];
  uint k = 6u * aggregate + lane;
  if (slot == RESIDUAL) {
    if (lane == 0u) is_free[aggregate] = held ? 0.0 : 1.0;
    coarse_q[k] = 0.0;
    coarse_r[k] = value;
  } else {
    float q = value + l.beta * coarse_q[k];
    coarse_q[k] = q;
    coarse_r[k] = l.coarse ? coarse_r[k] - l.alpha * q : 0.0;
  }
}

Lengths lengths_in(uint body) {
  return iteration() > 0u ? lengths(iteration(), body) : Lengths(0.0, 0.0, 0.0, AGGREGATES > 0);
}
// Leaves a body's iteration to its next.
void note(uint body, Lengths l) {
  iterations[2u * body + (iteration() & 1u)] = Iteration(l.rz, l.alpha, l.coarse ? 1u : 0u);
  if (iteration() == 0u && round_of_newton() == 0u) first_rz[body] = 0.0;
  else if (!(first_rz[body] > 0.0)) first_rz[body] = l.rz;
  if (iteration() == 1u && dots[body].x > 0.0) atomicMin(least, floatBitsToUint(l.alpha));
}

void main() {
  uint group = group_index();
  if (group < AGGREGATES) {
    restrict_to(group, iteration() == 0u ? RESIDUAL : PRODUCT, lengths_in(aggregate_bodies[group]));
    return;
  }
  uint i = (group - AGGREGATES) * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i < BODIES) note(i, lengths_in(i));
  if (i >= VERTICES || iteration() == 0u) return;
  Lengths l = lengths_in(body_of(i));
  if (!(l.alpha > 0.0)) return;
  Advanced now = advanced(i, l);
  vec3 slip = slip_direction(i);
  put(DIRECTION, i, now.direction, slip.x);
  put(IMAGE, i, now.image, slip.y);
  put(STEP, i, now.step, slip.z);
  put(RESIDUAL, i, now.residual, 0.0);
}
