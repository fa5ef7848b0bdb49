// After a change from outside: no step before this one is known. One invocation per vertex, and per aggregate.
#include "newton/newton.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i < VERTICES) {
    put(WAY, i, vec3(0.0), 0.0);
    put(GAIN, i, vec3(0.0), 0.0);
  }
  if (i < AGGREGATES)
    for (uint k = 0; k < 4; ++k) sums[ROTATIONS_AT + 4 * i + k] = k == 3 ? 1.0 : 0.0;
}
