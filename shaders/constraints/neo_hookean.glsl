#ifndef NEO_HOOKEAN
#define NEO_HOOKEAN
// Stable neo-Hookean elasticity of a tet (Smith, de Goes and Kim 2018, eq. 14) as two constraints (method.md eqs.
// 20-22), C_0 = sqrt(I - log(I + 1)) and C_1 = J - alpha, alpha = 1 + 3 mu / (4 lambda), where I is the sum of squared
// singular values of the deformation gradient and J its determinant.

// With compliances 1 / (mu V) and 1 / (lambda V) the energy C^2 / (2 compliance) is Smith's. At rest neither C is 0,
// and their forces cancel. A tet in a point or on a line has no gradient, and stays so until another tet moves its
// vertices.

// `rest` has the inverse of the metric of the sides at rest (a a, a b, a d, b b, b d, d d), 1 over 6 volumes, alpha.
Constraint4x2 neo_hookean(vec3 x[4], const real rest[8], Ids ids) {
  Constraint4x2 c;
  vec3 a = x[1] - x[0];
  vec3 b = x[2] - x[0];
  vec3 d = x[3] - x[0];
  vec3 toward_a = rest[0] * a + rest[1] * b + rest[2] * d;  // half the gradient of I
  vec3 toward_b = rest[1] * a + rest[3] * b + rest[4] * d;
  vec3 toward_d = rest[2] * a + rest[4] * b + rest[5] * d;
  real I = dot(toward_a, a) + dot(toward_b, b) + dot(toward_d, d);
  // Near 0 the difference has no digits left, but its series has.
  real square = I > real(0.03) ? I - log(I + real(1)) : I * I * (real(0.5) - I * (real(1) / real(3) - real(0.25) * I));
  c.C[0] = sqrt(max(square, real(0)));
  real share = c.C[0] > real(1e-15) ? I / ((I + real(1)) * c.C[0]) : real(1.4142135623730951);
  c.gradient[0][1] = share * toward_a;
  c.gradient[0][2] = share * toward_b;
  c.gradient[0][3] = share * toward_d;
  c.gradient[1][1] = rest[6] * cross(b, d);
  c.gradient[1][2] = rest[6] * cross(d, a);
  c.gradient[1][3] = rest[6] * cross(a, b);
  for (int k = 0; k < 2; ++k) c.gradient[k][0] = -(c.gradient[k][1] + c.gradient[k][2] + c.gradient[k][3]);
  c.C[1] = dot(c.gradient[1][3], d) - rest[7];
  c.guards = 0u;
  return c;
}
real neo_hookean_jacobian(vec3 x[4], const real rest[8]) {
  return dot(cross(x[1] - x[0], x[2] - x[0]), x[3] - x[0]) * rest[6];
}
// From a third of the trace of the squares' matrix, and of its deviator the length and the determinant.
real largest_singular_value(real third, real p, real det) {
  real angle = acos(clamp(p > real(0) ? (det / p) / (real(2) * p * p) : real(1), real(-1), real(1))) / real(3);
  return sqrt(max(third + real(2) * p * cos(angle), real(1e-12)));
}
// A block of the Hessian of the energy, with compliances a[0] and a[1], and a quarter of the difference of the
// gradients, where `beyond` is J - alpha and `own` 1 if that is the tet's own. The part that can be negative, (J -
// alpha) Hess J, is limited to the positive part, of I, over the largest singular value. At rest it is just that large,
// because a body turns freely.
EdgePart neo_hookean_edge(vec3 x[4], const real rest[8], const real a[2], real beyond, real own, int i, int j) {
  vec3 s1 = x[1] - x[0], s2 = x[2] - x[0], s3 = x[3] - x[0];
  vec3 t1 = rest[0] * s1 + rest[1] * s2 + rest[2] * s3;
  vec3 t2 = rest[1] * s1 + rest[3] * s2 + rest[4] * s3;
  vec3 t3 = rest[2] * s1 + rest[4] * s2 + rest[5] * s3;
  vec3 g1 = rest[6] * cross(s2, s3), g2 = rest[6] * cross(s3, s1), g3 = rest[6] * cross(s1, s2);
  real I = dot(t1, s1) + dot(t2, s2) + dot(t3, s3);
  // The squared singular values are the eigenvalues of the matrix of all t . s: the largest, by its deviator.
  real third = I / real(3), d11 = dot(t1, s1) - third, d22 = dot(t2, s2) - third, d33 = dot(t3, s3) - third;
  real d12 = dot(t1, s2), d13 = dot(t1, s3), d21 = dot(t2, s1), d23 = dot(t2, s3), d31 = dot(t3, s1), d32 = dot(t3, s2);
  real p =
      sqrt(max((d11 * d11 + d22 * d22 + d33 * d33) / real(6) + (d12 * d21 + d13 * d31 + d23 * d32) / real(3), real(0)));
  real det = d11 * (d22 * d33 - d23 * d32) - d12 * (d21 * d33 - d23 * d31) + d13 * (d21 * d32 - d22 * d31);
  real longest = largest_singular_value(third, p, det);
  real share = I / (I + real(1)), limit = share / (a[0] * longest);
  real bent = beyond / a[1], held = clamp(bent, -limit, limit);
  int low = min(i, j), high = max(i, j);
  real m12 = rest[1], m13 = rest[2], m23 = rest[4];
  real metric = low > 0 ? (low == 2 ? m23 : high == 2 ? m12 : m13)
                        : -(high == 1 ? rest[0] + m12 + m13 : high == 2 ? m12 + rest[3] + m23 : m13 + m23 + rest[5]);
  vec3 others = low > 0 ? (low == 2 ? -s1 : high == 2 ? -s3 : s2) : high == 1 ? s2 - s3 : high == 2 ? s3 - s1 : s1 - s2;
  vec3 t0 = -(t1 + t2 + t3), g0 = -(g1 + g2 + g3);
  vec3 ti = chosen(i, t0, t1, t2, t3), tj = chosen(j, t0, t1, t2, t3), gi = chosen(i, g0, g1, g2, g3),
       gj = chosen(j, g0, g1, g2, g3);
  EdgePart part;
  part.block = mat3(share * metric / a[0]) + outerProduct(ti * (real(2) / (a[0] * (I + real(1)) * (I + real(1)))), tj) +
               outerProduct(gi * (own / a[1]), gj) + cross_matrix(others * ((i < j ? held : -held) * rest[6]));
  part.force = (ti - tj) * (real(0.25) * share / a[0]) + (gi - gj) * (real(0.25) * bent);
  return part;
}
EdgePart neo_hookean_part(vec3 x[4], const real rest[8], const real a[2], int i, int j) {
  return neo_hookean_edge(x, rest, a, neo_hookean_jacobian(x, rest) - rest[7], real(1), i, j);
}
// What the energy asks of corner i alone. No part of the block can be negative, because J is linear in one corner.
VertexPart neo_hookean_corner(vec3 x[4], const real rest[8], const real a[2], int i) {
  vec3 s1 = x[1] - x[0], s2 = x[2] - x[0], s3 = x[3] - x[0];
  vec3 t1 = rest[0] * s1 + rest[1] * s2 + rest[2] * s3;
  vec3 t2 = rest[1] * s1 + rest[3] * s2 + rest[4] * s3;
  vec3 t3 = rest[2] * s1 + rest[4] * s2 + rest[5] * s3;
  vec3 g1 = rest[6] * cross(s2, s3), g2 = rest[6] * cross(s3, s1), g3 = rest[6] * cross(s1, s2);
  vec3 t = chosen(i, -(t1 + t2 + t3), t1, t2, t3), g = chosen(i, -(g1 + g2 + g3), g1, g2, g3);
  real metric = i == 1   ? rest[0]
                : i == 2 ? rest[3]
                : i == 3 ? rest[5]
                         : rest[0] + rest[3] + rest[5] + real(2) * (rest[1] + rest[2] + rest[4]);
  real I = dot(t1, s1) + dot(t2, s2) + dot(t3, s3), share = I / (I + real(1));
  VertexPart part;
  part.block = mat3(share * metric / a[0]) + outerProduct(t * (real(2) / (a[0] * (I + real(1)) * (I + real(1)))), t) +
               outerProduct(g * (real(1) / a[1]), g);
  part.gradient = t * (share / a[0]) + g * ((dot(g3, s3) - rest[7]) / a[1]);
  return part;
}
#endif
