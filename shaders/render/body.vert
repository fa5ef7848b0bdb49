// A vertex of tets or edges, straight from the simulation's buffer.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 high;
layout(location = ATTRIBUTE_LOW) in vec3 low;
layout(location = ATTRIBUTE_VALUE) in float value;
layout(location = ATTRIBUTE_REST) in vec4 rest;  // w: body

out Corner {
  vec3 position;
  float value;
  vec4 rest;
} corner;

void main() {
  corner.position = high + low;
  // A value that is not finite has no colour, so that its faces are dropped like those of a vertex that is not finite.
  if (!finite(vec3(value * 1e-30))) corner.position = vec3(uintBitsToFloat(0x7f800000u));
  corner.value = value;
  corner.rest = rest;
}
