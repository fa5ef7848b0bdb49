// Plastic flow of a tet (method.md eqs. 28-30). Its metric is that of rest values: the inverse of the metric of the
// sides at rest, which with the sides x gives the elastic strain.
struct RestMetric {
  real values[6];  // a a, a b, a d, b b, b d, d d
};
real metric_determinant(const real m[6]) {
  return m[0] * (m[3] * m[5] - m[4] * m[4]) - m[1] * (m[1] * m[5] - m[4] * m[2]) + m[2] * (m[1] * m[4] - m[3] * m[2]);
}
// What remains of the metric where the strain is beyond `yield_strain`, of which excess a part `kept` stays elastic.
// `rest_volume` is six volumes at rest, which flow does not change.
RestMetric yielded(vec3 x[4], const real m[6], real rest_volume, real yield_strain, real kept) {
  vec3 s1 = x[1] - x[0], s2 = x[2] - x[0], s3 = x[3] - x[0];
  vec3 t1 = m[0] * s1 + m[1] * s2 + m[2] * s3;
  vec3 t2 = m[1] * s1 + m[3] * s2 + m[4] * s3;
  vec3 t3 = m[2] * s1 + m[4] * s2 + m[5] * s3;
  // All t . s are a matrix whose eigenvalues are the squared principal stretches; p is sqrt(dev : dev / 6) of it.
  real third = (dot(t1, s1) + dot(t2, s2) + dot(t3, s3)) / real(3);
  real d11 = dot(t1, s1) - third, d22 = dot(t2, s2) - third, d33 = dot(t3, s3) - third;
  real across = dot(t1, s2) * dot(t2, s1) + dot(t1, s3) * dot(t3, s1) + dot(t2, s3) * dot(t3, s2);
  real p = sqrt(max((d11 * d11 + d22 * d22 + d33 * d33) / real(6) + across / real(3), real(0)));
  vec3 r1 = cross(s2, s3), r2 = cross(s3, s1), r3 = cross(s1, s2);
  real volume = dot(r1, s1), J = volume / rest_volume;
  // A tet that is nearly flat or turned over has no shape worth keeping.
  bool flows = yield_strain > real(0) && J > real(0.2);
  real unit = pow(flows ? J : real(1), real(2) / real(3)), strain = p / unit;
  flows = flows && strain > yield_strain;
  RestMetric result;
  for (int k = 0; k < 6; ++k) result.values[k] = m[k];
  if (flows) {
    real aim = yield_strain + kept * (strain - yield_strain);
    real mean = third / unit, first = real(3) * mean, second = real(3) * (mean * mean - strain * strain);
    // The deviator shrinks to a part t, and then the determinant, which is no longer 1, is put right: a cubic for t,
    // with one root between 0 and 1.
    real t = real(0);
    for (real span = real(0.5); span > real(1e-8); span *= real(0.5)) {
      real next = t + span, shrunk = next * strain / aim;
      real determinant =
          real(1) + next * (first - real(3) + next * (second - real(2) * first + real(3) + next * (first - second)));
      t = shrunk * shrunk * shrunk < determinant ? next : t;
    }
    real share = (real(1) - t) * unit / (volume * volume);
    result.values[0] = t * m[0] + share * dot(r1, r1);
    result.values[1] = t * m[1] + share * dot(r1, r2);
    result.values[2] = t * m[2] + share * dot(r1, r3);
    result.values[3] = t * m[3] + share * dot(r2, r2);
    result.values[4] = t * m[4] + share * dot(r2, r3);
    result.values[5] = t * m[5] + share * dot(r3, r3);
    real scale = pow(metric_determinant(result.values) * rest_volume * rest_volume, real(-1) / real(3));
    for (int k = 0; k < 6; ++k) result.values[k] *= scale;
  }
  return result;
}
