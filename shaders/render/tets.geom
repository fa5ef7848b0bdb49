// Draws a tet as four faces, or nothing if it is not finite.
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 12) out;
#include "render/faces.glsl"
#include "render/tet.glsl"

void main() {
  vec3 p[4];
  float value[4];
  if (!place_tet(p, value)) return;
  const ivec3 faces[4] = ivec3[](ivec3(0, 2, 1), ivec3(0, 1, 3), ivec3(0, 3, 2), ivec3(1, 2, 3));
  for (int f = 0; f < 4; ++f) {
    vec3 area = cross(p[faces[f].y] - p[faces[f].x], p[faces[f].z] - p[faces[f].x]);
    vec3 normal = area / max(length(area), 1e-30);
    for (int i = 0; i < 3; ++i) {
      int v = faces[f][i];
      gl_ClipDistance[0] = view.cut.w - dot(view.cut.xyz, corner[v].rest.xyz);
      emit(vec3(float(i == 0), float(i == 1), float(i == 2)), p[v], normal, value[v], tone());
    }
    EndPrimitive();
  }
}
