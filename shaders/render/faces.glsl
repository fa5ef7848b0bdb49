// What the geometry shaders take in and give out.
#include "render/view.glsl"

in Corner {
  vec3 position;
  float value;
  vec4 rest;
} corner[];

out Point {
  vec3 position;
  vec3 normal;
  vec3 edge;  // barycentric
  float value;
  flat vec3 albedo;
} point;

// Numbers are not mixed: an element has the colour of its first corner.
float shown_value(int i) { return corner[int(view.colour.x) == COLOUR_PATCH ? 0 : i].value; }

void emit(vec3 edge, vec3 position, vec3 normal, float value, vec3 albedo) {
#ifdef SHADOW
  gl_Position = light.matrix * vec4(position, 1.0);
#else
  gl_Position = view.camera * vec4(position, 1.0);
  point.position = position;
  point.normal = normal;
  point.edge = edge;
  point.value = value;
  point.albedo = albedo;
#endif
  EmitVertex();
}
