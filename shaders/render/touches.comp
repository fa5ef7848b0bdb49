// Makes an arrow for each pair of surfaces that touches, along the normal away from the other, with how much of their
// offset is missing (below 0: no arrow). There is an invocation per pair.
#include "layout.glsl"
#include "render/layout.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
#define ROW 1u
#include "contact/bodies/lists.glsl"
layout(std430) restrict readonly buffer Pairs { SurfacePair pairs[]; };
layout(std430) writeonly buffer Arrows { ContactArrow arrows[]; };
void main() {
  uint p = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (p >= uint(arrows.length())) return;
  arrows[p] = ContactArrow(vec3(0.0), -1.0, vec3(0.0), 0.0);
  if (p >= min(counts.pairs, uint(pairs.length())) || pairs[p].shares == 0u) return;
  SurfacePair pair = pairs[p];
  vec3 x = positions[pair.vertices[0]].high;
  if ((pair.first & OF_EDGES) != 0u) x = 0.5 * (x + positions[pair.vertices[1]].high);
  vec3 n = pair.normal.xyz;
  if (length(n) > 0.0) arrows[p] = ContactArrow(x, clamp(1.0 - pair.normal.w / pair.offset, 0.0, 1.0), n, 0.0);
}
