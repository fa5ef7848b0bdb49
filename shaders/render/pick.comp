// The first triangle along a ray. Stage 0: the least distance, as float bits (positive floats sort like their bits).
// Stage 1: the least triangle at exactly that distance. Stage 2, one thread: its corner nearest to the hit.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_PICK_TRIANGLES) readonly buffer Triangles { uint triangles[]; };
layout(std430, binding = BIND_PICK_RESULT) buffer Result {
  uint distance_bits;
  uint triangle;
  uint vertex;
};
uniform uint count;
uniform int stage;
uniform vec3 origin;
uniform vec3 direction;

vec3 position(uint v) { return positions[v].high + positions[v].low; }

// Distance to the triangle (Moeller, Trumbore 1997), or a negative number. Edges are a hair wider than they are, so that no ray
// slips between two triangles.
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

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (stage == 2) {
    if (i != 0u || triangle == 0xffffffffu) return;
    vec3 x = origin + uintBitsToFloat(distance_bits) * direction;
    float best = 3e38;
    for (uint k = 0u; k < 3u; ++k) {
      uint v = triangles[3u * triangle + k];
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
  if (!(t > 0.0 && t < 1e8)) return;  // beyond what is drawn: a triangle seen edge-on
  if (stage == 0) atomicMin(distance_bits, floatBitsToUint(t));
  else if (floatBitsToUint(t) == distance_bits) atomicMin(triangle, i);
}
