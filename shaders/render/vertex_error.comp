// Per vertex of the surface the mean over its tetrahedra of V/V0 - 1 (VOLUME), or over its edges of L/L0 - 1.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_RENDER_REST) readonly buffer Rest { vec4 rest[]; };
layout(std430, binding = BIND_RENDER_VERTICES) readonly buffer Vertices { uint vertices[]; };
layout(std430, binding = BIND_RENDER_OFFSETS) readonly buffer Offsets { uint offsets[]; };
layout(std430, binding = BIND_RENDER_ITEMS) readonly buffer Items { uint items[]; };  // the other corners
layout(std430, binding = BIND_RENDER_VALUES) writeonly buffer Values { float values[]; };
uniform uint count;

vec3 position(uint v) { return positions[v].high + positions[v].low; }

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

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  float sum = 0.0;
  uint n = 0u;
  for (uint k = offsets[i]; k < offsets[i + 1u]; ++k) {
    float e = error(vertices[i], k);
    if (!finite(vec3(e))) continue;
    sum += e;
    ++n;
  }
  values[vertices[i]] = n > 0u ? sum / float(n) : 0.0;
}
