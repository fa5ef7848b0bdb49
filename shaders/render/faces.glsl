// The inputs and outputs of the geometry shaders of bodies.
#include "render/view.glsl"
#include "render/point.glsl"

in Corner {
  vec3 position;
  float value;
  vec4 rest;
} corner[];

// Numbers of patches are not interpolated: an element has that of its first corner.
float shown_value(int i) { return corner[int(view.colour.x) == COLOUR_PATCH ? 0 : i].value; }

void emit(vec3 edge, vec3 position, vec3 normal, float value, vec3 albedo) {
  put(edge, position, normal, value, albedo);
  EmitVertex();
}
