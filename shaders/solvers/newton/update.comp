// An iteration's end: step lengths, the vectors of each vertex, and the coarse residual. Iteration 0: its beginning. A
// work-group per aggregate, then an invocation per vertex.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
shared vec3 forces[GROUP_SIZE], torques[GROUP_SIZE];

// The coarse residual of the vectors in `slot`, by its rotated rigid motions. An aggregate that a half space holds has
// none: it cannot move as one, and the coarse matrix does not know.
void restrict_to(uint aggregate, uint slot, Lengths l) {
  uint lane = gl_LocalInvocationIndex, end = first_member[aggregate + 1u];
  vec4 centre = centres[aggregate], back = opposite(rotations[aggregate]);
  vec3 force = vec3(0.0), torque = vec3(0.0);
  float held = 0.0;
  for (uint k = first_member[aggregate] + lane; k < end; k += GROUP_SIZE) {
    uint i = members[k].x;
    float weight = float(members[k].y) * WEIGHT_UNIT;
    vec3 f = weight * turned(back, at(slot, i).xyz);
    // Only at the beginning: in later iterations other work-groups rewrite residuals meanwhile.
    if (slot == RESIDUAL && held_by(at(RESIDUAL, i)) != 0u) held = 1.0;
    force += f;
    torque += cross((at(REST, i).xyz - centre.xyz) / centre.w, f);
  }
  forces[lane] = force;
  torques[lane] = torque;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane < half_size) {
      forces[lane] += forces[lane + half_size];
      torques[lane] += torques[lane + half_size];
    }
    barrier();
  }
  held = slot == RESIDUAL ? group_sum(vec2(held, 0.0)).x : 1.0 - is_free[aggregate];
  if (lane >= 6u) return;
  if (slot == RESIDUAL && lane == 0u) is_free[aggregate] = held > 0.0 ? 0.0 : 1.0;
  float value = held > 0.0 ? 0.0 : lane < 3u ? forces[0][lane] : torques[0][lane - 3u];
  uint k = 6u * aggregate + lane;
  if (slot == RESIDUAL) {
    coarse_q[k] = 0.0;
    coarse_r[k] = value;
  } else {
    float q = value + l.beta * coarse_q[k];
    coarse_q[k] = q;
    coarse_r[k] = l.coarse ? coarse_r[k] - l.alpha * q : 0.0;
  }
}

void main() {
  uint group = group_index();
  Lengths l = Lengths(0.0, 0.0, 0.0, AGGREGATES > 0);
  if (phases > 0u) l = lengths(phases);
  if (group == 0u && gl_LocalInvocationIndex == 0u) {
    iterations[phases & 1u] = Iteration(l.rz, l.alpha, l.coarse ? 1u : 0u);
    if (phases == 0u) first_rz = 0.0;
    else if (!(first_rz > 0.0)) first_rz = l.rz;
    if (phases == 1u && dots.x > 0.0) atomicMin(least, floatBitsToUint(l.alpha));
  }
  if (group < AGGREGATES) {
    restrict_to(group, phases == 0u ? RESIDUAL : PRODUCT, l);
    return;
  }
  uint i = (group - AGGREGATES) * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= VERTICES || phases == 0u || !(l.alpha > 0.0)) return;
  Advanced now = advanced(i, l);
  put(DIRECTION, i, now.direction, 0.0);
  put(IMAGE, i, now.image, 0.0);
  put(STEP, i, now.step, 0.0);
  put(RESIDUAL, i, now.residual, at(RESIDUAL, i).w);
}
