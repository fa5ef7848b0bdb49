// The corners of the surface's triangles as they are drawn, an invocation each. A corner's normal is the mean, weighted
// by angles, of the triangles around its vertex that make no sharp edge with its own. Geometry shaders would do it
// slowly on GPUs made for computing.
#include "render/view.glsl"
#include "render/gathered.glsl"
layout(std430) readonly buffer Triangles { uint triangles[]; };
layout(std430) readonly buffer Values { float values[]; };
layout(std430) writeonly buffer Corners { SurfaceCorner corners[]; };
uniform int valued, rested;  // 1: there are values; there are rest positions with bodies

vec3 normal_at(uint v, vec3 face) {
  vec3 x = position(v), sum = vec3(0.0);
  for (uint k = offsets[v]; k < offsets[v + 1u]; ++k) {
    vec3 a = position(items[2u * k]) - x, b = position(items[2u * k + 1u]) - x;
    vec3 area = cross(a, b);
    float size = length(area);
    if (!finite(a) || !finite(b) || !(size > 0.0) || dot(area, face) < view.eye.w * size) continue;
    sum += area / size * atan(size, dot(a, b));
  }
  float size = length(sum);
  return size > 0.0 ? sum / size : face;
}

void main() {
  uint c = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (c >= count) return;
  uint first = c - c % 3u, v = triangles[c];
  vec3 p[3];
  bool shown = true;
  for (uint k = 0u; k < 3u; ++k) {
    uint other = triangles[first + k];
    p[k] = position(other);
    // A value that is not finite has no colour.
    shown = shown && finite(p[k]) && (valued == 0 || finite(vec3(values[other] * 1e-30)));
  }
  vec3 area = cross(p[1] - p[0], p[2] - p[0]);
  vec3 normal = area / max(length(area), 1e-30);
  if (shown && view.eye.w <= 1.0) normal = normal_at(v, normal);
  vec4 r = rested != 0 ? rest[v] : vec4(0.0);
  SurfaceCorner corner;
  corner.position = shown ? p[c - first] : vec3(0.0);
  // Numbers of patches are not interpolated: a triangle has that of its first corner.
  corner.value = valued == 0 ? 0.0 : values[int(view.colour.x) == COLOUR_PATCH ? triangles[first] : v];
  corner.normal_xy = packSnorm2x16(normal.xy);
  corner.normal_z_body = packSnorm2x16(vec2(normal.z, r.w / 32767.0));
  corner.kept = rested != 0 ? view.cut.w - dot(view.cut.xyz, r.xyz) : 1.0;
  corner._0 = 0.0;
  corners[c] = corner;
}
