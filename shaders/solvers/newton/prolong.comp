// z = M^-1 r, by both levels of the preconditioner. One invocation per vertex.
#include "solvers/newton/newton.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= VERTICES) return;
  vec4 d = at(INVERSE, i), a = at(INVERSE2, i);
  uint holds = held_by(i);
  vec3 r = free_part(at(RESIDUAL, i).xyz, holds, i);
  mat3 B = mat3(d.x, a.x, a.y, a.x, d.y, a.z, a.y, a.z, d.z);
  vec3 z = B * r;
  if (at(AIM, i).w > 0.0 && AGGREGATES > 0) {
    vec3 rest = at(REST, i).xyz;
    for (uint k = 0u; k < 4u; ++k) {
      uint share = shares[i][k], aggregate = SHARE_AGGREGATE(share), y = 6u * aggregate;
      vec4 centre = centres[aggregate];
      vec3 shift = vec3(coarse_y[y], coarse_y[y + 1u], coarse_y[y + 2u]);
      vec3 turn = vec3(coarse_y[y + 3u], coarse_y[y + 4u], coarse_y[y + 5u]), arm = (rest - centre.xyz) / centre.w;
      z += turned(rotations[aggregate], shift + cross(turn, arm)) * (float(SHARE_WEIGHT(share)) * WEIGHT_UNIT);
    }
  }
  put(SEARCH, i, free_part(z, holds, i), 0.0);
}
