#include "render/view.glsl"
#include "render/colour.glsl"
in Point {
  vec3 position;
  vec3 normal;
  vec3 edge;
  float value;
  flat vec3 albedo;
} point;
layout(location = 0) out vec4 result;

void main() {
  int kind = int(view.colour.x);
  vec3 colour =
      kind == COLOUR_PLAIN ? 0.4 * point.albedo : scale_colour(kind, point.value, view.colour.y, view.colour.z);
  result = vec4(colour, 0.45 * view.material.w);  // what lies behind shows
}
