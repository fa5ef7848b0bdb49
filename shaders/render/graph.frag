#include "render/view.glsl"
#include "render/colour.glsl"
#include "render/point_in.glsl"
layout(location = 0) out vec4 result;

void main() {
  int kind = int(view.colour.x);
  vec3 colour =
      kind == COLOUR_PLAIN ? 0.4 * point.albedo : scale_colour(kind, point.value, view.colour.y, view.colour.z);
  result = vec4(colour, 0.45 * view.scene.z);  // transparent
}
