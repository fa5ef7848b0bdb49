// A vertex of an embedded surface, from the simulation's positions to the image or the shadow map. Vertex shaders may
// lack storage buffers in GL 4.3, hence textures.
#include "render/view.glsl"
#include "render/point.glsl"
layout(location = ATTRIBUTE_CARRIED) in uvec4 carried;  // packed by carried.cpp
layout(binding = UNIT_POSITIONS) uniform samplerBuffer positions;  // two texels each: Position
layout(binding = UNIT_TETS) uniform usamplerBuffer tets;
layout(binding = UNIT_REST) uniform samplerBuffer rest;
layout(binding = UNIT_COFACTORS) uniform samplerBuffer cofactors;  // three columns each
layout(binding = UNIT_VALUES) uniform samplerBuffer values;
uniform int valued;

// Unpacks a direction from an octahedron unfolded to a square.
vec3 unpack_normal(uint bits) {
  vec2 at = vec2(bits & 0xfffu, bits >> 12) / 2047.0 - 1.0;
  vec3 n = vec3(at, 1.0 - abs(at.x) - abs(at.y));
  float fold = max(-n.z, 0.0);
  n.xy -= vec2(n.x >= 0.0 ? fold : -fold, n.y >= 0.0 ? fold : -fold);
  return normalize(n);
}

void main() {
  vec3 last = vec3(carried.xyz & 0xffffffu) * (1.0 / 2097152.0) - 4.0;  // 24 bits of -4 to 4
  float weights[4] = float[](1.0 - last.x - last.y - last.z, last.x, last.y, last.z);
  vec3 n = unpack_normal(carried.x >> 24 | (carried.y >> 24) << 8 | (carried.z >> 24) << 16);
  uvec4 tet = texelFetch(tets, int(carried.w));
  vec3 p = vec3(0.0), normal = vec3(0.0);
  float value = 0.0;
  for (int k = 0; k < 4; ++k) {
    int v = int(tet[k]);
    p += weights[k] * (texelFetch(positions, 2 * v).xyz + texelFetch(positions, 2 * v + 1).xyz);
    for (int j = 0; j < 3; ++j) normal += weights[k] * n[j] * texelFetch(cofactors, 3 * v + j).xyz;
    if (valued != 0) value += weights[k] * texelFetch(values, v).x;
  }
  bool shown = finite(p) && finite(vec3(value * 1e-30));
  gl_ClipDistance[0] = shown ? 1.0 : -1e30;
  if (!shown) p = vec3(0.0);
  vec3 albedo = view.palette[int(texelFetch(rest, int(tet.x)).w) % PALETTE_SIZE].rgb;
  put(vec3(1.0), p, normal / max(length(normal), 1e-30), value, albedo);
}
