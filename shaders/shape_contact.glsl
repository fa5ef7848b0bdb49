// Vertices and the SHAPES obstacles that have a shape (method.md, "Shapes").
layout(std140, binding = BIND_SHAPES) uniform ShapeBlock {
  vec4 reaches[SHAPES];  // centres, and how far from there a shape is met within four substeps, by what it carries (reach_of, sim.cpp)
  Shape shapes[SHAPES];
};
#if FIELDS
layout(binding = UNIT_FIELDS) uniform samplerBuffer fields;
real texel(int i) { return texelFetch(fields, i).r; }
#else
real texel(int i) { return 0.0; }
#endif
#include "shapes.glsl"

vec3 from_centre(int k, Pair x) { return (x.high - shapes[k].centre) + (x.low - shapes[k].centre_low); }
vec3 into_shape(int k, vec3 v) { return vec3(dot(shapes[k].right, v), dot(shapes[k].up, v), dot(shapes[k].front, v)); }
// m/s, of the matter of shape k where x is.
vec3 shape_velocity(int k, Pair x) { return shapes[k].velocity + cross(shapes[k].spin, from_centre(k, x)); }
Solid solid_of(int k) {
  return Solid(shapes[k].kind, shapes[k].extent, shapes[k].radius, shapes[k].trust, shapes[k].spacing, shapes[k].origin, shapes[k].cells, shapes[k].first);
}
// Whether the straight way `times` (way - carried), `way` so long and `carried` what shape k carries x by, may meet it: it is as near as that,
// of either end.
bool may_meet(int k, Pair x, float way, float times) {
  vec3 arm = x.high - reaches[k].xyz;
  float most = reaches[k].w + 2.0 * times * way;
  return dot(arm, arm) <= most * most;
}
// A bit for each shape that may be met.
uint shapes_near(Pair x, float way, float times) {
  uint bits = 0u;
  for (int k = 0; k < SHAPES; ++k) bits |= may_meet(k, x, way, times) ? 1u << k : 0u;
  return bits;
}
float gap_to(int k, Pair x) { return surface_of(solid_of(k), into_shape(k, from_centre(k, x))).distance; }
// What a vertex at x meets of shape k that came there by `way`, relative to the shape.
Surface met(int k, Pair x, vec3 way) {
  vec3 to = into_shape(k, from_centre(k, x));
  Surface s = meeting(solid_of(k), to - into_shape(k, way), to);
  return Surface(s.normal.x * shapes[k].right + s.normal.y * shapes[k].up + s.normal.z * shapes[k].front, s.distance);
}
