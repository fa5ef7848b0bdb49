// Values of the surface's vertices, each gathered from its items in fixed order, so the same every time. NORMAL: the sum
// of the adjacent triangles' normals weighted by their angle there. VOLUME: the mean over its tetrahedra of V/V0 - 1.
// Otherwise the mean over its edges of L/L0 - 1. Other vertices have no items.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_RENDER_REST) readonly buffer Rest { vec4 rest[]; };
layout(std430, binding = BIND_RENDER_OFFSETS) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = BIND_RENDER_ITEMS) readonly buffer Items { uint items[]; };  // the other corners
#ifdef NORMAL
#define Value vec4
#else
#define Value float
#endif
layout(std430, binding = BIND_RENDER_VALUES) writeonly buffer Values { Value values[]; };
uniform uint count;

vec3 position(uint v) { return positions[v].high + positions[v].low; }

#ifdef NORMAL
Value gathered(uint v) {
  vec3 x = position(v), sum = vec3(0.0);
  for (uint k = offsets[v]; k < offsets[v + 1u]; ++k) {
    vec3 a = position(items[2u * k]) - x, b = position(items[2u * k + 1u]) - x;
    vec3 area = cross(a, b);
    float size = length(area);
    if (!finite(a) || !finite(b) || !(size > 0.0)) continue;
    sum += area / size * atan(size, dot(a, b));
  }
  float size = length(sum);
  return vec4(size > 0.0 ? sum / size : vec3(0.0), 0.0);
}
#else
#ifdef VOLUME
float error(uint v, uint k) {
  uint a = items[3u * k], b = items[3u * k + 1u], c = items[3u * k + 2u];
  vec3 x = position(v), x0 = rest[v].xyz;
  float now = dot(cross(position(a) - x, position(b) - x), position(c) - x);
  return now / dot(cross(rest[a].xyz - x0, rest[b].xyz - x0), rest[c].xyz - x0) - 1.0;
}
#else
float error(uint v, uint k) {
  return distance(position(items[k]), position(v)) / distance(rest[items[k]].xyz, rest[v].xyz) - 1.0;
}
#endif

Value gathered(uint v) {
  float sum = 0.0;
  uint n = 0u;
  for (uint k = offsets[v]; k < offsets[v + 1u]; ++k) {
    float e = error(v, k);
    if (!finite(vec3(e))) continue;
    sum += e;
    ++n;
  }
  return n > 0u ? sum / float(n) : 0.0;
}
#endif

void main() {
  uint v = gl_GlobalInvocationID.x;
  if (v < count) values[v] = gathered(v);
}
