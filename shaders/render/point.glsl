// A corner on its way to the image or, with SHADOW, to the shadow map.
out Point {
  vec3 position;
  vec3 normal;
  vec3 edge;  // barycentric
  float value;
  flat vec3 albedo;
} point;

void put(vec3 edge, vec3 position, vec3 normal, float value, vec3 albedo) {
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
}
