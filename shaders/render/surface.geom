// A triangle of the surface: its normal, its edges, or nothing when a vertex is not finite.
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
#include "render/faces.glsl"

void main() {
  vec3 p[3] = vec3[](corner[0].position, corner[1].position, corner[2].position);
  if (!finite(p[0]) || !finite(p[1]) || !finite(p[2])) return;
  vec3 area = cross(p[1] - p[0], p[2] - p[0]);
  vec3 flat_normal = area / max(length(area), 1e-30);
  vec3 albedo = view.palette[int(corner[0].rest.w) % PALETTE_SIZE].rgb;
  for (int i = 0; i < 3; ++i) {
    bool smooth_one = view.eye.w > 0.0 && dot(corner[i].normal, corner[i].normal) > 0.0;
    gl_ClipDistance[0] = view.cut.w - dot(view.cut.xyz, corner[i].rest.xyz);
    emit(vec3(float(i == 0), float(i == 1), float(i == 2)), p[i], smooth_one ? corner[i].normal : flat_normal, shown_value(i), albedo);
  }
  EndPrimitive();
}
