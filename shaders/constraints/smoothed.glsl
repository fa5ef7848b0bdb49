// Smoothed tets (method.md, "Smoothed tets"; Dohrmann et al. 2000, Puso and Solberg 2006): neo-Hookean ones whose J is
// averaged around each vertex, and which leave a part of their resistance to shear to the averages of F there.
#ifndef __cplusplus
#include "constraints/neo_hookean.glsl"
#endif

// As if by itself: solvers put smoothed_J() in place of J in C[1].
Constraint4x2 smoothed(vec3 x[4], const real rest[8], Ids ids) { return neo_hookean(x, rest, ids); }
real smoothed_jacobian(vec3 x[4], const real rest[8]) { return neo_hookean_jacobian(x, rest); }
// Averages do not see a tet that goes flat while its neighbours grow: beyond a change of 30 % it resists by itself.
real own_resistance(real J) { return J - clamp(J, real(0.7), real(1.3)); }
// By the mean of its vertices' averages and its own J.
real smoothed_J(real mean, real J) { return mean + own_resistance(J); }
// As neo_hookean_part().
EdgePart smoothed_part(vec3 x[4], const real rest[8], const real a[2], real mean, int i, int j) {
  real J = neo_hookean_jacobian(x, rest);
  real own = own_resistance(J) != real(0) ? real(1) : real(0);
  return neo_hookean_edge(x, rest, a, smoothed_J(mean, J) - rest[7], own, i, j);
}
// b of method.md eq. 34. What averages resist is about half of what a tet of its own resists, which is added where it
// does.
real smoothed_bound(Constraint4x2 c, vec3 x[4], real w[4], const real rest[8], const real a[2]) {
  return stiffness_bound(c, x, w, a) * (own_resistance(c.C[1] + rest[7]) != real(0) ? real(3) : real(1));
}
// The gradient of the tet's own J by corner i.
vec3 smoothed_slope(vec3 x[4], const real rest[8], int i) {
  vec3 s1 = x[1] - x[0], s2 = x[2] - x[0], s3 = x[3] - x[0];
  vec3 g1 = cross(s2, s3), g2 = cross(s3, s1), g3 = cross(s1, s2);
  return chosen(i, -(g1 + g2 + g3), g1, g2, g3) * rest[6];
}

mat3 cofactors(mat3 F) { return mat3(cross(F[1], F[2]), cross(F[2], F[0]), cross(F[0], F[1])); }
real squares(mat3 F) { return dot(F[0], F[0]) + dot(F[1], F[1]) + dot(F[2], F[2]); }
// The stress by which an average F resists shear, over its modulus: the gradient of (I - 3) / 2 - 3/4 (J - 1) -
// log((I + 1) / 4) / 2.
mat3 shear_stress(mat3 F) {
  return F * (real(1) - real(1) / (squares(F) + real(1))) - cofactors(F) * real(0.75);
}
// The change of shear_stress() with F, of which the part that can be negative is `held` times the change of cofactors:
// -3/4, or shear_hold() where the result is to be positive.
mat3 shear_change(mat3 F, mat3 d, real held) {
  real I = squares(F) + real(1);
  real along = real(2) * (dot(F[0], d[0]) + dot(F[1], d[1]) + dot(F[2], d[2])) / (I * I);
  mat3 turned = mat3(cross(d[1], F[2]) + cross(F[1], d[2]), cross(d[2], F[0]) + cross(F[2], d[0]),
                     cross(d[0], F[1]) + cross(F[0], d[1]));
  return d * (real(1) - real(1) / I) + F * along + turned * held;
}
// As neo_hookean_edge() limits it: by the largest singular value.
real shear_hold(mat3 F) {
  real I = squares(F), third = I / real(3);
  real d0 = dot(F[0], F[0]) - third, d1 = dot(F[1], F[1]) - third, d2 = dot(F[2], F[2]) - third;
  real a = dot(F[0], F[1]), b = dot(F[0], F[2]), c = dot(F[1], F[2]);
  real p = sqrt(max((d0 * d0 + d1 * d1 + d2 * d2) / real(6) + (a * a + b * b + c * c) / real(3), real(0)));
  real det = d0 * (d1 * d2 - c * c) - a * (a * d2 - c * b) + b * (a * c - d1 * b);
  return max(real(-0.75), -I / ((I + real(1)) * largest_singular_value(third, p, det)));
}
