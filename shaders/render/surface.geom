// A triangle of the surface: its normal, its edges, or nothing when a vertex is not finite.
#include "render/view.glsl"
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

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

void main() {
  vec3 p[3] = vec3[](corner[0].position, corner[1].position, corner[2].position);
  if (!finite(p[0]) || !finite(p[1]) || !finite(p[2])) return;
  vec3 area = cross(p[1] - p[0], p[2] - p[0]);
  vec3 flat_normal = area / max(length(area), 1e-30);
  for (int i = 0; i < 3; ++i) {
#ifdef SHADOW
    gl_Position = light.matrix * vec4(p[i], 1.0);
#else
    gl_Position = view.camera * vec4(p[i], 1.0);
    point.position = p[i];
    point.normal = view.eye.w > 0.0 && dot(corner[i].normal, corner[i].normal) > 0.0 ? corner[i].normal : flat_normal;
    point.edge = vec3(float(i == 0), float(i == 1), float(i == 2));
    point.value = corner[i].value;
    point.albedo = view.palette[int(corner[0].rest.w) % PALETTE_SIZE].rgb;
#endif
    EmitVertex();
  }
  EndPrimitive();
}
