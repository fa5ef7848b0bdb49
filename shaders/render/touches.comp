// An arrow for each vertex that is in a triangle of another body: where it is, the triangle's normal, and how deep it is, below 0 where there
// is none. One invocation per record of contact (pairs/pairs.glsl).
#include "layout.glsl"
#include "render/layout.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_RENDER_TRIANGLES) readonly buffer PairMesh { uint pair_mesh[]; };
layout(std430, binding = BIND_RENDER_OFFSETS) readonly buffer PairLists { uint pair_lists[]; };
layout(std430, binding = BIND_RENDER_VALUES) writeonly buffer Arrows { TouchArrow arrows[]; };
uniform uint count, vertices_at, records_at, record_words;

void main() {
  uint record = gl_GlobalInvocationID.x, k = records_at + record_words * record;
  if (record >= count) return;
  uint t = record < pair_lists[1] ? pair_lists[k + 1u] : 0xffffffffu;
  arrows[record] = TouchArrow(vec3(0.0), -1.0, vec3(0.0), 0.0);
  if (t == 0xffffffffu) return;
  vec3 x = positions[pair_mesh[vertices_at + 3u * pair_lists[k]]].high, corners[3];
  for (uint c = 0u; c < 3u; ++c) corners[c] = positions[pair_mesh[4u * t + c]].high - x;
  vec3 n = cross(corners[1] - corners[0], corners[2] - corners[0]);
  float area = length(n);
  if (area > 0.0) arrows[record] = TouchArrow(x, max(dot(corners[0], n / area), 0.0), n / area, 0.0);
}
