#include "collision.glsl"
// Corrects a vertex out of all half spaces; `moved`: its displacement in this substep before the correction.
Pair resolve_contacts(Pair x, vec3 moved) {
  for (int k = 0; k < params.plane_count; ++k) {
    vec4 plane = params.planes[k];
    float depth = (dot(plane.xyz, x.high) - plane.w) + dot(plane.xyz, x.low);
    if (depth < 0.0) {
      vec3 correction = plane_correction(plane.xyz, depth, moved, params.friction);
      x = pair_add(x, correction);
      moved += correction;
    }
  }
  return x;
}
