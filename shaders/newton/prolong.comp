// z: the residual by both levels. One invocation per vertex.
#include "newton/newton.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= VERTICES) return;
  vec4 residual = at(RESIDUAL, i), d = at(INVERSE, i), a = at(INVERSE2, i);
  uint holds = held_by(residual);
  vec3 r = free_part(residual.xyz, holds, i);
  mat3 B = mat3(d.x, a.x, a.y, a.x, d.y, a.z, a.y, a.z, d.z);
  vec3 z = B * r;
  if (at(AIM, i).w > 0.0 && AGGREGATES > 0) {
    vec3 rest = at(REST, i).xyz;
    for (uint k = 0u; k < 4u; ++k) {
      uint word = mesh[WEIGHTS_AT + 4u * i + k], aggregate = word >> 16, y = COARSE_Y + 6u * aggregate;
      vec4 centre = centre_of(aggregate);
      vec3 way = vec3(sums[y], sums[y + 1u], sums[y + 2u]), turn = vec3(sums[y + 3u], sums[y + 4u], sums[y + 5u]);
      z += turned(rotation_of(aggregate), way + cross(turn, (rest - centre.xyz) / centre.w)) * (float(word & 65535u) * (1.0 / 65535.0));
    }
  }
  put(SEARCH, i, free_part(z, holds, i), 0.0);
}
