// A corner of an obstacle, from its own coordinates, to the image or the shadow map.
#include "render/view.glsl"
#include "render/point.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 own_position;
layout(location = ATTRIBUTE_NORMAL) in vec3 own_normal;
uniform vec3 right, up, front, centre;  // its pose
uniform int chosen;

void main() {
  mat3 axes = mat3(right, up, front);
  vec3 position = centre + axes * own_position;
  vec3 albedo = chosen != 0 ? vec3(0.62, 0.60, 0.36) : vec3(0.42, 0.48, 0.54);
  put(vec3(1.0), position, axes * own_normal, 0.0, albedo);
}
