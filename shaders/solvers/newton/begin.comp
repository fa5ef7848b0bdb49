// Forgets the steps before a change from outside. One invocation per vertex, per body and per aggregate.
#include "solvers/newton/newton.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i < VERTICES) {
    put(DISPLACEMENT, i, vec3(0.0), 0.0);
    put(GAIN, i, vec3(0.0), 0.0);
    put(LEFT, i, vec3(0.0), 0.0);
    put(OWN, i, vec3(0.0), 0.0);
    put(OWN2, i, vec3(0.0), 0.0);
  }
  if (i < BODIES) motions[i] = BodyMotion(vec4(0.0, 0.0, 0.0, 1.0), vec3(0.0), 1.0, vec3(0.0), 0.0, vec3(0.0), 0.0);
  if (i < AGGREGATES) rotations[i] = vec4(0.0, 0.0, 0.0, 1.0);
}
