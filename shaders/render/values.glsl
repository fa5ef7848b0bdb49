// The values of a tet with corners p, at rest r, that colours show; compiled as GLSL and as C++.
#ifndef __cplusplus
#include "energy.glsl"
#endif

// The mean of L/L0 - 1 over its edges.
float tet_strain(vec3 p[4], vec3 r[4]) {
  float sum = 0.0f;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) sum += distance(p[i], p[j]) / distance(r[i], r[j]) - 1.0f;
  return sum / 6.0f;
}

// The largest error of its constraints relative to rest, where `kinds` is 1: edges, 2: the volume, 3: both.
float tet_residual(vec3 p[4], vec3 r[4], float kinds) {
  float most = kinds > 1.5f ? abs(six_volumes(p) / six_volumes(r) - 1.0f) : 0.0f;
  if (kinds == 2.0f) return most;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) most = max(most, abs(distance(p[i], p[j]) / distance(r[i], r[j]) - 1.0f));
  return most;
}

float tet_value(int kind, vec3 p[4], vec3 r[4], vec4 material) {
  return kind == COLOUR_VOLUME     ? six_volumes(p) / six_volumes(r) - 1.0f
         : kind == COLOUR_STRETCH  ? tet_strain(p, r)
         : kind == COLOUR_RESIDUAL ? tet_residual(p, r, material.w)
                                   : tet_energy(p, r, material);
}
