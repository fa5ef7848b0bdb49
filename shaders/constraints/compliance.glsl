// What compliance and damping make of a multiplier (XPBD, Macklin, Mueller and Chentanez 2016; method.md eqs. 25-26). GLSL and C++, as
// types.glsl. `c.C` is the whole residual, C + a lambda + gamma (C - C at the substep's start), with a = alpha / h^2 and gamma = tau / h;
// `share` is (1 + gamma) / omega: the relaxation leaves a alone, so that one iteration of a short substep is right too.
real multiplier(Constraint2 c, real w[2], real k, real limit, real a, real share) {
  real g0 = dot(c.gradient[0], c.gradient[0]), g1 = dot(c.gradient[1], c.gradient[1]);
  real sum = share * (w[0] * g0 + w[1] * g1) + a;
  return bounded(k * c.C, sum, max(w[0] * w[0] * g0, w[1] * w[1] * g1), limit);
}
real multiplier(Constraint4 c, real w[4], real k, real limit, real a, real share) {
  real sum = real(0), longest = real(0);
  for (int j = 0; j < 4; ++j) {
    real g = w[j] * dot(c.gradient[j], c.gradient[j]);
    sum += g;
    longest = max(longest, w[j] * g);
  }
  sum = max(sum, c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3]));
  return bounded(k * c.C, share * sum + a, longest, limit);
}

// The guards that such a multiplier took.
uint guards_of(Constraint2 c, real w[2], real k, real limit, real a, real share) {
  real g0 = dot(c.gradient[0], c.gradient[0]), g1 = dot(c.gradient[1], c.gradient[1]);
  real sum = share * (w[0] * g0 + w[1] * g1) + a;
  return c.guards | guards_of(k * c.C, sum, max(w[0] * w[0] * g0, w[1] * w[1] * g1), limit);
}
uint guards_of(Constraint4 c, real w[4], real k, real limit, real a, real share) {
  real sum = real(0), longest = real(0);
  for (int j = 0; j < 4; ++j) {
    real g = w[j] * dot(c.gradient[j], c.gradient[j]);
    sum += g;
    longest = max(longest, w[j] * g);
  }
  real least = c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3]);
  uint floored = c.C != real(0) && sum < least ? GUARD_FLOOR : 0u;
  return c.guards | floored | guards_of(k * c.C, share * max(sum, least) + a, longest, limit);
}
