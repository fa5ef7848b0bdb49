// Stable neo-Hookean elasticity of a tet (Smith, de Goes and Kim 2018, eq. 14) as two constraints (method.md eqs. 29-31): with I the sum of
// squared singular values of the deformation gradient and J its determinant,
//   C_0 = sqrt(I - log(I + 1)),  C_1 = J - alpha,  alpha = 1 + 3 mu / (4 lambda),
// and compliances 1 / (mu V), 1 / (lambda V), the energy C^2 / (2 compliance) is Smith's. At rest neither is 0: their forces cancel.
// `rest`: the inverse of the metric of the sides at rest (a a, a b, a d, b b, b d, d d), 1 over 6 volumes, alpha.
// A tet in a point or on a line has no gradient: it stays so until another moves its vertices.
Constraint4x2 neo_hookean(vec3 x[4], const real rest[8], Ids ids) {
  Constraint4x2 c;
  vec3 a = x[1] - x[0];
  vec3 b = x[2] - x[0];
  vec3 d = x[3] - x[0];
  vec3 toward_a = rest[0] * a + rest[1] * b + rest[2] * d;  // half the gradient of I
  vec3 toward_b = rest[1] * a + rest[3] * b + rest[4] * d;
  vec3 toward_d = rest[2] * a + rest[4] * b + rest[5] * d;
  real I = dot(toward_a, a) + dot(toward_b, b) + dot(toward_d, d);
  // Near 0 the difference has no digits left, and its series has.
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
