// Begins a second round of Newton where the first has ended. One invocation per vertex.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
#include "solvers/newton/starts.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= VERTICES) return;
  DoubleSingle x = position(i);
  vec3 u = start_displacement(i, x) + advanced(i, lengths(iteration(), body_of(i))).step;
  put(START, i, u, at(START, i).w);
  write_starts(i, x, u);
}
