// Where Newton starts, where bodies that obstacles stop start rigidly: a stiff body that its vertices stop one by one
// would start crushed, and few iterations would leave much of that. One invocation per vertex.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/starts.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= VERTICES) return;
  DoubleSingle x = position(i);
  bool stiff = is_held_stiff(i);
  vec3 aim = stiff ? predict(i, false, 1.0) : at(AIM, i).xyz;  // it may have met an obstacle only now
  if (at(AIM, i).w > 0.0) aim += rigid_displacement(i, x, aim);
  put(START, i, aim, stiff ? 1.0 : 0.0);
  write_starts(i, x, aim);
}
