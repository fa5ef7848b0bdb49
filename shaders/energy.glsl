// The elastic energy of a tet, compiled as GLSL and as C++.
float six_volumes(vec3 p[4]) { return dot(cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]); }

// Stable neo-Hookean energy of a deformation gradient F with determinant J, J/m^3. The terms of first order in the
// strain cancel on paper; in floats they would leave 1e-7 of the modulus, more than a stiff body ever stores. So it is
// written in D = F^T F - 1, without them.
float neo_hookean_energy(mat3 F, float J, float shear, float first) {
  float mu = 4.0f / 3.0f * shear, lambda = first + 5.0f / 6.0f * shear;
  mat3 D = transpose(F) * F;
  for (int i = 0; i < 3; ++i) D[i][i] -= 1.0f;
  float t = D[0][0] + D[1][1] + D[2][2];
  float second = D[0][0] * D[1][1] + D[1][1] * D[2][2] + D[2][2] * D[0][0] - D[0][1] * D[0][1] - D[1][2] * D[1][2] -
                 D[2][0] * D[2][0] + determinant(D);
  float a = 0.25f * t;
  float rest = abs(a) < 0.03f ? a * a * (0.5f - a * (1.0f / 3.0f - a * (0.25f - a * 0.2f))) : a - log(1.0f + a);
  // J - 1, from J^2 - 1 = t + second where that is the more accurate.
  float j = J > 0.5f ? (t + second) / (1.0f + J) : J - 1.0f;
  float shape = J > 0.5f ? (t + second) * j / (2.0f + j) - second : t - 2.0f * j;
  return 0.5f * (mu * rest + 0.75f * mu * shape + lambda * j * j);
}

// `material` has Lame's mu and lambda in Pa, then 1 for stable neo-Hookean (method.md, "Materials"), 2 for springs, 3
// for neo-Hookean of smoothed tets, and s of these; or 0 for no energy.

// The energy of shear alone, of such a modulus.
float shear_energy(mat3 F, float J, float shear) { return neo_hookean_energy(F, J, shear, -5.0f / 6.0f * shear); }
// J/m^3 at rest, of a smoothed tet itself: a part of shear, and of volume what it resists by itself (smoothed.glsl). Of
// a linear one all.
float own_energy(mat3 F, float J, vec4 material) {
  bool smoothed = material.z == 3.0f;
  float shear = smoothed ? material.w * material.x : material.x;
  float beyond = smoothed ? J - clamp(J, 0.7f, 1.3f) : 0.0f, lambda = material.y + 5.0f / 6.0f * material.x;
  float first = smoothed ? -5.0f / 6.0f * shear : material.y;
  return neo_hookean_energy(F, J, shear, first) + 0.5f * lambda * beyond * beyond;
}
// J/m^3 at rest, of what smoothed tets leave to the averages around a vertex.
float averaged_energy(mat3 F, float J, vec4 material) {
  float lambda = material.y + 5.0f / 6.0f * material.x;
  return shear_energy(F, determinant(F), (1.0f - material.w) * material.x) + 0.5f * lambda * (J - 1.0f) * (J - 1.0f);
}

// The elastic energy, J/m^3 at rest, of a tet with corners p, at rest r; of a smoothed one its own.
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
  if (material.z == 0.0f) return 0.0f;
  mat3 F = mat3(p[1] - p[0], p[2] - p[0], p[3] - p[0]) * inverse(mat3(r[1] - r[0], r[2] - r[0], r[3] - r[0]));
  return own_energy(F, J, material);
}
