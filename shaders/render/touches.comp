// An arrow for each vertex or sharp edge that is in another body: where it is, along which normal it leaves, and how deep it is, below 0 where there
// is none. One invocation per record of contact (pairs/pairs.glsl).
#include "layout.glsl"
#include "render/layout.glsl"
#define real float
#include "pairs/formulas.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_RENDER_TRIANGLES) readonly buffer PairMesh { uint pair_mesh[]; };
layout(std430, binding = BIND_RENDER_OFFSETS) readonly buffer PairLists { uint pair_lists[]; };
layout(std430, binding = BIND_RENDER_VALUES) writeonly buffer Arrows { TouchArrow arrows[]; };
uniform uint count, triangles, vertices, edges_at, vertices_at, records_at, record_words;

vec3 place(uint at) { return positions[pair_mesh[at]].high; }
void main() {
  uint record = gl_GlobalInvocationID.x, k = records_at + record_words * record;
  if (record >= count) return;
  uint t = record < pair_lists[3u /* RECORDS */] ? pair_lists[k + 1u] : 0xffffffffu, s = pair_lists[k];
  arrows[record] = TouchArrow(vec3(0.0), -1.0, vec3(0.0), 0.0);
  if (t == 0xffffffffu) return;
  bool under = (t & 0x40000000u) != 0u;
  t &= 0x3fffffffu;
  vec3 x, n;
  float depth;
  if (s >= vertices) {
    uint own = edges_at + 5u * (s - vertices), other = edges_at + 5u * (t - triangles);
    vec3 p = place(own), q = place(own + 1u), a = place(other), b = place(other + 1u);
    n = cross(q - p, b - a);
    float outwards = dot(n, edge_normal(b - a, place(other + 2u) - a, place(other + 3u) - a));
    n *= outwards < 0.0 ? -1.0 : 1.0;
    x = 0.5 * (p + q);
    depth = dot(a - p, n) / max(length(n), 1e-30);
  } else {
    x = place(vertices_at + 2u * s);
    vec3 a = place(4u * t) - x;
    n = cross(place(4u * t + 1u) - x - a, place(4u * t + 2u) - x - a) * (under ? -1.0 : 1.0);
    depth = dot(a, n) / max(length(n), 1e-30);
  }
  if (length(n) > 0.0) arrows[record] = TouchArrow(x, max(depth, 0.0), normalize(n), 0.0);
}
