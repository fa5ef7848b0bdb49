// Normals of the surface's vertices: the sum of the adjacent triangles' normals weighted by their angle there, in fixed
// order, so the same every time.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_RENDER_VERTICES) readonly buffer Vertices { uint vertices[]; };
layout(std430, binding = BIND_RENDER_OFFSETS) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = BIND_RENDER_ITEMS) readonly buffer Items { uint items[]; };  // the triangle's other two
layout(std430, binding = BIND_RENDER_VALUES) writeonly buffer Values { vec4 normals[]; };
uniform uint count;

vec3 position(uint v) { return positions[v].high + positions[v].low; }

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  uint v = vertices[i];
  vec3 x = position(v), sum = vec3(0.0);
  for (uint k = offsets[i]; k < offsets[i + 1u]; ++k) {
    vec3 a = position(items[2u * k]) - x, b = position(items[2u * k + 1u]) - x;
    vec3 area = cross(a, b);
    float size = length(area);
    if (!finite(a) || !finite(b) || !(size > 0.0)) continue;
    sum += area / size * atan(size, dot(a, b));
  }
  float size = length(sum);
  normals[v] = vec4(size > 0.0 ? sum / size : vec3(0.0), 0.0);
}
