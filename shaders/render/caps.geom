// The section of a tet with the cut: a triangle or a quadrilateral.
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 6) out;
#include "render/faces.glsl"
#include "render/tet.glsl"

void main() {
  vec3 p[4];
  float value[4], above[4];
  if (!place_tet(p, value)) return;
  int high[4], low[4], highs = 0, lows = 0;
  for (int i = 0; i < 4; ++i) {
    above[i] = dot(view.cut.xyz, corner[i].rest.xyz) - view.cut.w;
    if (above[i] > 0.0) high[highs++] = i;
    else low[lows++] = i;
  }
  if (highs == 0 || lows == 0) return;
  // The points of the cut on edges of the tet, in their order around the polygon.
  vec3 at[4];
  float shown[4];
  int n = 0;
  for (int i = 0; i < highs; ++i)
    for (int j = 0; j < lows; ++j) {
      int a = high[i], b = low[i == 1 && lows == 2 ? 1 - j : j];
      float part = above[a] / (above[a] - above[b]);
      at[n] = mix(p[a], p[b], part);
      shown[n++] = mix(value[a], value[b], part);
    }
  vec3 area = cross(at[1] - at[0], at[2] - at[0]);
  if (n == 4) area += cross(at[2] - at[0], at[3] - at[0]);
  bool turned = dot(area, p[high[0]] - at[0]) < 0.0;
  vec3 normal = (turned ? -area : area) / max(length(area), 1e-30);
  for (int t = 2; t < n; ++t) {
    // An inner edge of the polygon is not drawn, since its coordinate stays 1.
    vec3 inner = vec3(0.0, float(n == 4 && t == 2), float(n == 4 && t == 3));
    for (int k = 0; k < 3; ++k) {
      int i = turned ? 2 - k : k, from = i == 0 ? 0 : t + i - 2;
      vec3 edge = max(vec3(float(i == 0), float(i == 1), float(i == 2)), inner);
      gl_ClipDistance[0] = 1.0;
      emit(edge, at[from], normal, shown[from], tone());
    }
    EndPrimitive();
  }
}
