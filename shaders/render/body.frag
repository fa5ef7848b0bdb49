#include "render/view.glsl"
#include "render/colour.glsl"
#include "render/light.glsl"

in Point {
  vec3 position;
  vec3 normal;
  vec3 edge;
  float value;
  flat vec3 albedo;
} point;

layout(location = 0) out vec4 result;

// How much of this pixel a triangle's edge covers, about 1.2 pixels wide.
float edge_cover(vec3 barycentric) {
  vec3 pixel = fwidth(barycentric);
  vec3 cover = 1.0 - smoothstep(pixel * 0.3, pixel * 1.3, barycentric);
  // Of triangles a few pixels wide the edges would be all one sees: there they give way.
  float dense = smoothstep(0.12, 0.7, max(pixel.x, max(pixel.y, pixel.z)));
  return max(cover.x, max(cover.y, cover.z)) * (1.0 - 0.65 * dense);
}

void main() {
  int kind = int(view.colour.x);
  vec3 albedo = kind == COLOUR_PLAIN ? point.albedo
                                     : scale_colour(kind, point.value, view.colour.y, view.colour.z);
  float side = gl_FrontFacing ? 1.0 : -1.0;
  vec3 face = normalize(cross(dFdx(point.position), dFdy(point.position)));
  if (dot(face, view.eye.xyz - point.position) < 0.0) face = -face;
  vec3 normal = side * normalize(point.normal);
  if (view.colour.w > 0.0) albedo = mix(albedo, vec3(0.86), kind == COLOUR_PLAIN ? 0.45 : 0.0);
  vec3 colour = shade(albedo, point.position, normal, body_shadow(point.position, face));
  if (view.colour.w > 0.0) {
    vec3 ink = kind == COLOUR_PLAIN ? point.albedo * 0.22 : vec3(0.03);
    colour = mix(colour, ink, view.colour.w * edge_cover(point.edge));
  }
  result = vec4(colour, view.material.w);
}
