// The rotation, as a quaternion w, x, y, z, that best aligns a body's rest shape with it, from s[3 * a + b] = sum m X_a
// x_b with the rest positions X about their centre of mass, so that x needs no centring (Horn 1987: the eigenvector of
// the largest eigenvalue of a symmetric 4x4 matrix, here by cyclic Jacobi rotations).
vec4 best_rotation(float s[9]) {
  float scale = 0.0;
  for (int k = 0; k < 9; ++k) scale = max(scale, abs(s[k]));
  for (int k = 0; k < 9; ++k) s[k] = scale > 0.0 ? s[k] / scale : 0.0;
  float xx = s[0], xy = s[1], xz = s[2], yx = s[3], yy = s[4], yz = s[5], zx = s[6], zy = s[7], zz = s[8];
  mat4 n = mat4(xx + yy + zz, yz - zy, zx - xz, xy - yx,
                yz - zy, xx - yy - zz, xy + yx, zx + xz,
                zx - xz, xy + yx, -xx + yy - zz, yz + zy,
                xy - yx, zx + xz, yz + zy, -xx - yy + zz);
  mat4 vectors = mat4(1.0);
  bool turned = true;
  for (int sweep = 0; sweep < 12 && turned; ++sweep) {
    turned = false;
    for (int p = 0; p < 3; ++p)
      for (int q = p + 1; q < 4; ++q) {
        if (abs(n[p][q]) < 1e-9) continue;
        turned = true;
        float theta = (n[q][q] - n[p][p]) / (2.0 * n[p][q]);
        float t = (theta >= 0.0 ? 1.0 : -1.0) / (abs(theta) + sqrt(theta * theta + 1.0));
        float c = inversesqrt(t * t + 1.0), d = t * c;
        vec4 np = n[p], vp = vectors[p];
        n[p] = c * np - d * n[q], n[q] = d * np + c * n[q];
        vectors[p] = c * vp - d * vectors[q], vectors[q] = d * vp + c * vectors[q];
        for (int k = 0; k < 4; ++k) {
          float a = n[k][p], b = n[k][q];
          n[k][p] = c * a - d * b, n[k][q] = d * a + c * b;
        }
        n[p][q] = n[q][p] = 0.0;
      }
  }
  vec4 best = vectors[0];
  float largest = n[0][0];
  for (int k = 1; k < 4; ++k)
    if (n[k][k] > largest) best = vectors[k], largest = n[k][k];
  return normalize(best);
}
