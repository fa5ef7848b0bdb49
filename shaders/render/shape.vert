// A corner of an obstacle, from its own coordinates, to the image or the shadow map.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 own_position;
layout(location = ATTRIBUTE_NORMAL) in vec3 own_normal;
uniform vec3 right, up, front, centre;  // where it stands
uniform int chosen;
out Point {
  vec3 position;
  vec3 normal;
  vec3 edge;  // barycentric
  float value;
  flat vec3 albedo;
} point;

void main() {
  mat3 axes = mat3(right, up, front);
  vec3 position = centre + axes * own_position;
#ifdef SHADOW
  gl_Position = light.matrix * vec4(position, 1.0);
#else
  gl_Position = view.camera * vec4(position, 1.0);
  point.position = position;
  point.normal = axes * own_normal;
  point.edge = vec3(1.0);
  point.value = 0.0;
  point.albedo = chosen != 0 ? vec3(0.62, 0.60, 0.36) : vec3(0.42, 0.48, 0.54);
#endif
}
