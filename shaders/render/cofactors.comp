// The cofactors at each vertex of the mean deformation gradient F of its tets, weighted by volume at rest, which turn
// the normals of an embedded surface. Interpolated within tets, such means leave no kinks where tets join.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
#include "render/gathered.glsl"
layout(std430) writeonly buffer Values { vec4 cofactors[]; };

void main() {
  uint v = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (v >= count) return;
  vec3 x = position(v), r = rest[v].xyz;
  mat3 f = mat3(0.0);
  float volume = 0.0;
  for (uint k = offsets[v]; k < offsets[v + 1u]; ++k) {
    uint a = items[3u * k], b = items[3u * k + 1u], c = items[3u * k + 2u];
    vec3 p = rest[a].xyz - r, q = rest[b].xyz - r, s = rest[c].xyz - r;
    mat3 now = mat3(position(a) - x, position(b) - x, position(c) - x);
    if (!finite(now[0]) || !finite(now[1]) || !finite(now[2])) continue;
    // F = now * inverse(mat3(p, q, s)), whose rows are these over the volume.
    f += outerProduct(now[0], cross(q, s)) + outerProduct(now[1], cross(s, p)) + outerProduct(now[2], cross(p, q));
    volume += dot(cross(p, q), s);
  }
  f = volume > 0.0 ? f * (1.0 / volume) : mat3(1.0);
  for (uint k = 0u; k < 3u; ++k) cofactors[3u * v + k] = vec4(cross(f[(k + 1u) % 3u], f[(k + 2u) % 3u]), 0.0);
}
