// One work-group adds the partial sums into the row, then finds the centre of mass and the rotation that best aligns
// the rest shape (Horn 1987: the largest eigenvector of a symmetric 4x4 matrix, here by cyclic Jacobi rotations).
#include "measure/reduce.glsl"

void main() {
  int me = int(gl_LocalInvocationIndex);
  if (me < M_ANGULAR) row[me] = total(me);
  if (me != 0) return;  // the rest reads the partial sums, not the row that other invocations write
  vec3 centre;
  for (int a = 0; a < 3; ++a) centre[a] = total(M_MOMENT + a) / mass;
  // s[3*a + b] = sum m X_a x_b. The rest positions X are about their centre of mass, so x needs no centring.
  float s[9], scale = 0.0;
  for (int k = 0; k < 9; ++k) s[k] = total(M_COVARIANCE + k), scale = max(scale, abs(s[k]));
  for (int k = 0; k < 9; ++k) s[k] = scale > 0.0 ? s[k] / scale : 0.0;
  float xx = s[0], xy = s[1], xz = s[2], yx = s[3], yy = s[4], yz = s[5], zx = s[6], zy = s[7], zz = s[8];
  mat4 n = mat4(xx + yy + zz, yz - zy, zx - xz, xy - yx,
                yz - zy, xx - yy - zz, xy + yx, zx + xz,
                zx - xz, xy + yx, -xx + yy - zz, yz + zy,
                xy - yx, zx + xz, yz + zy, -xx - yy + zz);
  mat4 vectors = mat4(1.0);
  for (int sweep = 0; sweep < 12; ++sweep)
    for (int p = 0; p < 3; ++p)
      for (int q = p + 1; q < 4; ++q) {
        if (abs(n[p][q]) < 1e-30) continue;
        float theta = (n[q][q] - n[p][p]) / (2.0 * n[p][q]);
        float t = (theta >= 0.0 ? 1.0 : -1.0) / (abs(theta) + sqrt(theta * theta + 1.0));
        float c = inversesqrt(t * t + 1.0), d = t * c;
        mat4 turn = mat4(1.0);
        turn[p][p] = c, turn[q][q] = c, turn[q][p] = d, turn[p][q] = -d;
        n = transpose(turn) * n * turn;
        vectors = vectors * turn;
      }
  int best = 0;
  for (int k = 1; k < 4; ++k)
    if (n[k][k] > n[best][best]) best = k;
  vec4 rotation = normalize(vectors[best]);
  vec3 origin = positions[vertex_range.x].high + positions[vertex_range.x].low;
  for (int a = 0; a < 3; ++a) row[M_CENTRE + a] = centre[a], row[M_ORIGIN + a] = origin[a];
  for (int a = 0; a < 4; ++a) row[M_ROTATION + a] = rotation[a];
}
