// Finds the first triangle along a ray, or with TETS the first tet as it is shown. Stage 0 finds the least distance, as
// float bits, which sort like positive floats; stage 1 the least triangle at exactly that distance; stage 2, with one
// invocation, its corner nearest to the hit.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/view.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) readonly buffer Triangles { uint triangles[]; };
layout(std430) buffer Result {
  uint distance_bits;
  uint triangle;
  uint vertex;
};
uniform uint count;
uniform int stage;
uniform vec3 origin, direction;

vec3 position(uint v) { return positions[v].high + positions[v].low; }

#ifdef TETS
#define CORNERS 4u
layout(std430) readonly buffer Rest { vec4 rest[]; };

// The distance at which the ray enters the part of the tet that the cut leaves, or a negative number. That part is
// bounded by conditions start + rise t >= 0: the tet's barycentric coordinates, and the cut, which is linear in these.
float hit(uint t) {
  vec3 p[4];
  float kept[4];
  for (uint k = 0u; k < 4u; ++k) {
    uint v = triangles[4u * t + k];
    p[k] = position(v);
    kept[k] = view.cut.w - dot(view.cut.xyz, rest[v].xyz);
    if (!finite(p[k])) return -1.0;
  }
  shrink_tet(p);
  mat3 sides = mat3(p[1] - p[0], p[2] - p[0], p[3] - p[0]);
  if (determinant(sides) == 0.0) return -1.0;
  mat3 to_coordinates = inverse(sides);
  vec3 a = to_coordinates * (origin - p[0]), b = to_coordinates * direction;
  vec3 slope = vec3(kept[1], kept[2], kept[3]) - kept[0];
  float start[5] = float[](a.x, a.y, a.z, 1.0 - a.x - a.y - a.z, kept[0] + dot(slope, a));
  float rise[5] = float[](b.x, b.y, b.z, -b.x - b.y - b.z, dot(slope, b));
  float low = 0.0, high = 1e8;
  for (int k = 0; k < (view.cut.w < 1e29 ? 5 : 4); ++k) {
    float s = start[k] + (k < 4 ? 1e-6 : 0.0);
    if (rise[k] > 0.0) low = max(low, -s / rise[k]);
    else if (rise[k] < 0.0) high = min(high, -s / rise[k]);
    else if (s < 0.0) return -1.0;
  }
  return low <= high ? low : -1.0;
}
#else
#define CORNERS 3u
// The distance to the triangle (Moeller, Trumbore 1997), or a negative number. Triangles are larger by 1e-6, so that no
// ray slips between two of them.
float hit(uint t) {
  vec3 a = position(triangles[3u * t]), b = position(triangles[3u * t + 1u]), c = position(triangles[3u * t + 2u]);
  if (!finite(a) || !finite(b) || !finite(c)) return -1.0;
  vec3 e1 = b - a, e2 = c - a, p = cross(direction, e2), s = origin - a;
  float determinant = dot(e1, p);
  if (determinant == 0.0) return -1.0;
  vec3 q = cross(s, e1);
  float u = dot(s, p) / determinant, v = dot(direction, q) / determinant;
  const float slack = 1e-6;
  return u >= -slack && v >= -slack && u + v <= 1.0 + slack ? dot(e2, q) / determinant : -1.0;
}
#endif

void main() {
  uint i = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (stage == 2) {
    if (i != 0u || triangle == 0xffffffffu) return;
    vec3 x = origin + uintBitsToFloat(distance_bits) * direction;
    float best = 3e38;
    for (uint k = 0u; k < CORNERS; ++k) {
      uint v = triangles[CORNERS * triangle + k];
      float d = distance(position(v), x);
      if (d < best) {
        best = d;
        vertex = v;
      }
    }
    return;
  }
  if (i >= count) return;
  float t = hit(i);
  if (!(t > 0.0 && t < 1e8)) return;  // only triangles seen edge-on are hit beyond 1e8 m
  if (stage == 0) atomicMin(distance_bits, floatBitsToUint(t));
  else if (floatBitsToUint(t) == distance_bits) atomicMin(triangle, i);
}
