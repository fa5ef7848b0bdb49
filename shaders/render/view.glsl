#include "render/layout.glsl"
layout(std140, binding = BIND_RENDER_VIEW) uniform ViewBlock { View view; };
layout(std140, binding = BIND_RENDER_LIGHT) uniform LightBlock { Light light; };

// Towards the key light; fixed in the world, so that shadows stay where they are while the camera turns.
const vec3 key_direction = vec3(0.4558, 0.8184, 0.3500);

#include "render/finite.glsl"
