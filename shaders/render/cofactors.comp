// Of each vertex the cofactors of the mean deformation gradient F of its tetrahedra, by volume at rest: what turns the
// normals of a surface that rides on them. Means of vertices, mixed within a tetrahedron, leave no kinks where
// tetrahedra meet.
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
  cofactors[3u * v] = vec4(cross(f[1], f[2]), 0.0);
  cofactors[3u * v + 1u] = vec4(cross(f[2], f[0]), 0.0);
  cofactors[3u * v + 2u] = vec4(cross(f[0], f[1]), 0.0);
}
