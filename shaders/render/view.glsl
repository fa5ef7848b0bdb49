#include "layout.glsl"
#include "render/layout.glsl"
layout(std140, binding = BIND_RENDER_VIEW) uniform ViewBlock { View view; };
layout(std140, binding = BIND_RENDER_LIGHT) uniform LightBlock { Light light; };

// The direction towards the key light, which is fixed in the world so that shadows stay while the camera turns.
const vec3 key_direction = vec3(0.4558, 0.8184, 0.3500);

#include "render/finite.glsl"

// Shrinks a tet towards its centre, and moves it away from that of the bodies.
void shrink_tet(inout vec3 p[4]) {
  vec3 centre = 0.25 * (p[0] + p[1] + p[2] + p[3]);
  vec3 moved = centre + (view.tets.y > 0.0 ? view.tets.y * (centre - light.centre.xyz) : vec3(0.0));
  for (int i = 0; i < 4; ++i) p[i] = moved + (p[i] - centre) * (1.0 - view.tets.x);
}
