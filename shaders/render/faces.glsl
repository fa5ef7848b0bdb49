// What the geometry shaders take in and give out.
#include "render/view.glsl"

in Corner {
  vec3 position;
  vec3 normal;
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

/// Corner `i` of a triangle.
void emit(int i, vec3 position, vec3 normal, float value, vec3 albedo) {
#ifdef SHADOW
  gl_Position = light.matrix * vec4(position, 1.0);
#else
  gl_Position = view.camera * vec4(position, 1.0);
  point.position = position;
  point.normal = normal;
  point.edge = vec3(float(i == 0), float(i == 1), float(i == 2));
  point.value = value;
  point.albedo = albedo;
#endif
  EmitVertex();
}
