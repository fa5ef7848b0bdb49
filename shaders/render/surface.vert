// A corner of the surface (corners.comp), to the image or the shadow map.
#include "render/view.glsl"
#include "render/point.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 position;
layout(location = ATTRIBUTE_LOW) in float kept;
layout(location = ATTRIBUTE_NORMAL) in vec4 normal;  // w: body
layout(location = ATTRIBUTE_VALUE) in float value;

void main() {
  gl_ClipDistance[0] = kept;
  int k = gl_VertexID % 3;
  vec3 albedo = view.palette[int(normal.w * 32767.0 + 0.5) % PALETTE_SIZE].rgb;
  put(vec3(float(k == 0), float(k == 1), float(k == 2)), position, normal.xyz, value, albedo);
}
