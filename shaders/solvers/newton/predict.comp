// Where inertia takes each vertex (method.md eq. 35), which is where Newton starts unless bodies start rigidly. One
// invocation per vertex.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/starts.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  for (uint k = 0u; k < 6u && i < BODIES; ++k) bad_starts[6u * i + k] = 0u;
  if (i >= VERTICES) return;
#if TOUCHING
  put(PRESS, i, vec3(0.0), 0.0), put(PRESS_LOW, i, vec3(0.0), 0.0);
  put(BLOCK, i, vec3(0.0), 0.0), put(BLOCK2, i, vec3(0.0), 0.0);
  put(OWN2, i, at(OWN2, i).xyz, at(OWN, i).w), put(OWN, i, at(OWN, i).xyz, 0.0);
  put(HELD, i, vec3(0.0), 0.0), put(HELD2, i, vec3(0.0), 0.0);
#endif
  bool held = RIGID_START == 1u && is_held_stiff(i), known = is_step_known(i) && !held;
  vec3 aim = predict(i, known, known || held ? 1.0 : 0.5);
#if !RIGID_START
  write_starts(i, position(i), aim);
#endif
}
