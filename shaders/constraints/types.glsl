// What every constraint formula returns, and what a solver makes of it. GLSL and C++ (sim/formulas.h): `real` is float or double, vec3 follows it. No formula
// returns early: at least one driver makes loops of that which cost more than all the rest (docs/decisions.md).
// C and its gradient by each vertex; `floor` bounds sum |gradient|^2 from below where the gradient can vanish
// with C still large (same unit as |gradient|^2; 0 where it cannot); `guards`: bits of layout.glsl's GUARD_*.
// `ids`: what id_of(ids, j) finds the number of the constraint's vertex j by; asked for in guards only.
struct Constraint2 {
  real C;
  vec3 gradient[2];
  real floor;
  uint guards;
};
struct Constraint4 {
  real C;
  vec3 gradient[4];
  real floor;
  uint guards;
};

// A direction for two vertices in one place: of unit length, the opposite one for (b, a), and unlike that of other pairs,
// so that a body that has collapsed to a point does not unfold along a line only.
vec3 any_direction(uint a, uint b) {
  uint h = min(a, b) * 0x9E3779B9u + max(a, b) * 0x85EBCA6Bu;
  h = (h ^ (h >> 16)) * 0x7FEB352Du;
  h = (h ^ (h >> 15)) * 0x846CA68Bu;
  h = h ^ (h >> 16);
  vec3 d = vec3(real(int(h & 1023u) - 511), real(int((h >> 10) & 1023u) - 511), real(int(h >> 20) - 2047)) +
           vec3(real(0.5));
  d.z *= real(0.25);
  return (a < b ? real(1) : real(-1)) * (d / length(d));
}

// A constraint error that rounding alone can make is no error: without this, rounding noise of 1e-9 m divided by a
// substep of 1e-6 s becomes a velocity (method.md, "What float drops").
// `noise`: the size that C is known to rounding of. Positions themselves are known to rounding * quantization_size (0 where they are kept
// in full).
real apply_dead_zone(real C, real noise) { return abs(C) <= real(4) * rounding * noise ? real(0) : C; }

// Of a constraint with inverse masses w: sum w |grad C|^2, the largest w^2 |grad C|^2, and what bounds the sum from below.
struct Weighted {
  real sum;
  real longest;
  real least;
};
Weighted weighted(Constraint2 c, real w[2]) {
  real g0 = dot(c.gradient[0], c.gradient[0]), g1 = dot(c.gradient[1], c.gradient[1]);
  return Weighted(w[0] * g0 + w[1] * g1, max(w[0] * w[0] * g0, w[1] * w[1] * g1), real(0));
}
Weighted weighted(Constraint4 c, real w[4]) {
  real sum = real(0), longest = real(0);
  for (int j = 0; j < 4; ++j) {
    real g = w[j] * dot(c.gradient[j], c.gradient[j]);
    sum += g;
    longest = max(longest, w[j] * g);
  }
  return Weighted(sum, longest, c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3]));
}

// -C / sum, less where the longest correction, sqrt(longest) times that, exceeds `max_correction`; 0 where that is no number.
real bounded(real C, real sum, real longest, real max_correction) {
  real lambda = sum > real(0) ? -C / sum : real(0);
  real squared = lambda * lambda * longest;
  if (squared > max_correction * max_correction) lambda *= max_correction / sqrt(squared);
  return squared * real(0) == real(0) ? lambda : real(0);
}
// The guards that bounded() took.
uint bounded_guards(real C, real sum, real longest, real max_correction) {
  real lambda = sum > real(0) ? -C / sum : real(0);
  real squared = lambda * lambda * longest;
  return squared <= max_correction * max_correction ? 0u : squared * real(0) == real(0) ? GUARD_LIMIT : GUARD_NOT_FINITE;
}

// The multiplier (method.md eqs. 4, 25-26): lambda w_j grad_j C moves vertex j, by `max_correction` (one body size) at most. XPBD's (Macklin,
// Mueller and Chentanez 2016), of which PBD's is the one with a = 0 and share = 1: `c.C` is the whole residual,
// C + a lambda + gamma (C - C at the substep's start), with a = alpha / h^2 and gamma = tau / h; `share` is (1 + gamma) / omega: the
// relaxation leaves a alone, so that one iteration of a short substep is right too.
real multiplier(Constraint2 c, real w[2], real k, real max_correction, real a, real share) {
  Weighted s = weighted(c, w);
  return bounded(k * c.C, share * s.sum + a, s.longest, max_correction);
}
real multiplier(Constraint4 c, real w[4], real k, real max_correction, real a, real share) {
  Weighted s = weighted(c, w);
  return bounded(k * c.C, share * max(s.sum, s.least) + a, s.longest, max_correction);
}

// The guards that such a multiplier took.
uint guards_of(Constraint2 c, real w[2], real k, real max_correction, real a, real share) {
  Weighted s = weighted(c, w);
  return c.guards | bounded_guards(k * c.C, share * s.sum + a, s.longest, max_correction);
}
uint guards_of(Constraint4 c, real w[4], real k, real max_correction, real a, real share) {
  Weighted s = weighted(c, w);
  uint floored = c.C != real(0) && s.sum < s.least ? GUARD_FLOOR : 0u;
  return c.guards | floored | bounded_guards(k * c.C, share * max(s.sum, s.least) + a, s.longest, max_correction);
}
