// Where vertices are at Newton's start (AT_END 0), or where the last iteration ends, for press.comp. One invocation per
// vertex.
#define WITHOUT_VELOCITIES
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= VERTICES) return;
  vec4 aim = at(AIM, i);
  vec3 u = aim.xyz;
  if (aim.w > 0.0) {
    u = start_displacement(i, position(i));
#if AT_END
    if (iteration() > 0u) u += advanced(i, lengths(iteration(), body_of(i))).step;
#endif
  }
  put(MOVED, i, u, 0.0);
}
