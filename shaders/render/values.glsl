// What colours show of a tetrahedron with corners p, at rest r; compiled as GLSL and as C++.
#ifndef __cplusplus
#include "energy.glsl"
#endif

// The mean over its edges of L/L0 - 1.
float tet_strain(vec3 p[4], vec3 r[4]) {
  float sum = 0.0f;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) sum += distance(p[i], p[j]) / distance(r[i], r[j]) - 1.0f;
  return sum / 6.0f;
}

float tet_value(int kind, vec3 p[4], vec3 r[4], vec4 material) {
  return kind == COLOUR_VOLUME    ? six_volumes(p) / six_volumes(r) - 1.0f
         : kind == COLOUR_STRETCH ? tet_strain(p, r)
                                  : tet_energy(p, r, material);
}
