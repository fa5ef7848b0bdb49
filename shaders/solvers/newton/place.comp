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
  if (at(AIM, i).w > 0.0) {
    bool whole = motions[body_of(i)].whole > 0.0;
    vec3 from = whole ? vec3(0.0) : aim;
    aim = from + rigid_displacement(i, x, from);
    // What touched stays until the body has sprung back: rigidly it would be lifted off, and then pressed back in.
    uint touched = whole ? touched_before(i) : 0u;
    for (int k = 0; k < obstacle_count() && touched != 0u; ++k) {
      if ((touched & (1u << k)) == 0u) continue;
      Surface plane = surface_ahead(k, x, aim, aim);
      aim -= plane.normal * max(plane.distance, 0.0);
    }
  }
  put(START, i, aim, stiff ? 1.0 : 0.0);
  write_starts(i, x, aim);
}
