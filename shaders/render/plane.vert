// A corner of a square on a plane of the view, around the point nearest to `centre`.
#include "render/view.glsl"
uniform int plane;
uniform vec3 centre;
uniform float extent;
out vec3 position;
out vec2 across;  // m, coordinates along the plane

void main() {
  vec3 n = view.planes[plane].xyz;
  vec3 u = normalize(abs(n.x) < 0.9 ? vec3(1.0, 0.0, 0.0) - n * n.x : vec3(0.0, 0.0, 1.0) - n * n.z);
  vec3 v = cross(u, n);
  vec3 middle = centre - n * (dot(n, centre) - view.planes[plane].w);
  vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2.0 - 1.0;
  position = middle + extent * (corner.x * u + corner.y * v);
  across = vec2(dot(position, u), dot(position, v));
  gl_Position = view.camera * vec4(position, 1.0);
}
