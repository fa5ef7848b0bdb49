// A point of a body in fragment shaders (point.glsl).
in Point {
  vec3 position;
  vec3 normal;
  vec3 edge;
  float value;
  flat vec3 albedo;
} point;
