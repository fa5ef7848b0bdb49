#include "render/view.glsl"
#include "render/colour.glsl"
#include "render/light.glsl"
#include "render/point_in.glsl"
layout(location = 0) out vec4 result;

// The part of this pixel that the triangle's edges cover. They are lines one pixel wide, of which each side draws its
// half, and fade where triangles are only a few pixels wide.
float edge_cover(vec3 barycentric) {
  vec3 dx = dFdx(barycentric), dy = dFdy(barycentric), pixel = sqrt(dx * dx + dy * dy);
  vec3 cover = clamp(1.0 - barycentric / max(pixel, vec3(1e-9)), 0.0, 1.0);
  float dense = smoothstep(0.08, 0.45, max(pixel.x, max(pixel.y, pixel.z)));
  return max(cover.x, max(cover.y, cover.z)) * (1.0 - 0.75 * dense);
}

void main() {
  int kind = int(view.colour.x);
#ifdef SHAPE
  bool plain = true;
#else
  bool plain = kind == COLOUR_PLAIN;
#endif
  vec3 albedo = plain ? point.albedo : scale_colour(kind, point.value, view.colour.y, view.colour.z);
  vec3 normal = normalize(gl_FrontFacing ? point.normal : -point.normal);
  vec3 colour = shade(albedo, point.position, normal, plain);
  if (view.colour.w > 0.0) colour *= 1.0 - view.colour.w * edge_cover(point.edge);
  result = vec4(colour, view.scene.z);
}
