#include "collision.glsl"
float depth_of(Pair x, vec4 plane) { return (dot(plane.xyz, x.high) - plane.w) + dot(plane.xyz, x.low); }
bool touches(Pair x) {
  bool any = params.plane_count > 0 && depth_of(x, params.planes[0]) < 0.0;  // mostly there is one, or none
  for (int k = 1; k < params.plane_count; ++k) any = any || depth_of(x, params.planes[k]) < 0.0;
  return any;
}
// Corrects a vertex out of all half spaces; `moved`: its displacement in this substep before the correction.
Pair resolve_contacts(Pair x, vec3 moved) {
  for (int k = 0; k < params.plane_count; ++k) {
    vec4 plane = params.planes[k];
    float depth = depth_of(x, plane);
    if (depth < 0.0) {
      vec3 correction = plane_correction(plane.xyz, depth, moved, params.friction);
      x = pair_add(x, correction);
      moved += correction;
    }
  }
  return x;
}
