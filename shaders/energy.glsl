// The elastic energy of a tet, compiled as GLSL and as C++.
float six_volumes(vec3 p[4]) { return dot(cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]); }

// The elastic energy, J/m^3 at rest, of a tet with corners p, at rest r. `material` has Lame's mu and lambda in Pa,
// then 1 for stable neo-Hookean (method.md, "Materials"), 2 for springs, or 0 for no energy.
float tet_energy(vec3 p[4], vec3 r[4], vec4 material) {
  float J = six_volumes(p) / six_volumes(r);
  if (material.z == 2.0f) {
    float sum = 0.0f;
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        float e = distance(p[i], p[j]) / distance(r[i], r[j]) - 1.0f;
        sum += e * e;
      }
    return 1.25f * material.x * sum + 0.5f * (material.y - material.x) * (J - 1.0f) * (J - 1.0f);
  }
  if (material.z != 1.0f) return 0.0f;
  float mu = 4.0f / 3.0f * material.x, lambda = material.y + 5.0f / 6.0f * material.x,
        alpha = 1.0f + 0.75f * mu / lambda;
  mat3 F = mat3(p[1] - p[0], p[2] - p[0], p[3] - p[0]) * inverse(mat3(r[1] - r[0], r[2] - r[0], r[3] - r[0]));
  float I = dot(F[0], F[0]) + dot(F[1], F[1]) + dot(F[2], F[2]);
  return 0.5f * (mu * (I - 3.0f - log(0.25f * (I + 1.0f))) + lambda * (J - 1.0f) * (J + 1.0f - 2.0f * alpha));
}
