// A corner of the surface (corners.comp), to the image or the shadow map.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 position;
layout(location = ATTRIBUTE_LOW) in float kept;
layout(location = ATTRIBUTE_NORMAL) in vec4 normal;  // w: body
layout(location = ATTRIBUTE_VALUE) in float value;
out Point {
  vec3 position;
  vec3 normal;
  vec3 edge;  // barycentric
  float value;
  flat vec3 albedo;
} point;

void main() {
  gl_ClipDistance[0] = kept;
#ifdef SHADOW
  gl_Position = light.matrix * vec4(position, 1.0);
#else
  gl_Position = view.camera * vec4(position, 1.0);
  int k = gl_VertexID % 3;
  point.position = position;
  point.normal = normal.xyz;
  point.edge = vec3(float(k == 0), float(k == 1), float(k == 2));
  point.value = value;
  point.albedo = view.palette[int(normal.w * 32767.0 + 0.5) % PALETTE_SIZE].rgb;
#endif
}
