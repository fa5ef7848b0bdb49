// What every constraint formula returns. GLSL and C++ (sim/formulas.h): `real` is float or double, vec3 follows it. No formula
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
// `noise`: the size that C is known to rounding of. Positions themselves are known to rounding * grain (0 where they are kept in full).
real resolved(real C, real noise) { return abs(C) <= real(4) * rounding * noise ? real(0) : C; }

// -C / sum, less where the longest correction, sqrt(longest) times that, exceeds `limit`.
real bounded(real C, real sum, real longest, real limit) {
  real lambda = sum > real(0) ? -C / sum : real(0);
  real squared = lambda * lambda * longest;
  if (squared > limit * limit) lambda *= limit / sqrt(squared);
  return squared * real(0) == real(0) ? lambda : real(0);
}
uint guards_of(real C, real sum, real longest, real limit) {
  real lambda = sum > real(0) ? -C / sum : real(0);
  real squared = lambda * lambda * longest;
  return squared <= limit * limit ? 0u : squared * real(0) == real(0) ? GUARD_LIMIT : GUARD_NOT_FINITE;
}

// k lambda (method.md eq. 4), so that lambda w_j grad_j C moves vertex j; less where any would move by more than `limit` (one body
// size); 0 where nothing can move or what comes out is no number.
real multiplier(Constraint2 c, real w[2], real k, real limit) {
  real g0 = dot(c.gradient[0], c.gradient[0]), g1 = dot(c.gradient[1], c.gradient[1]);
  return bounded(k * c.C, w[0] * g0 + w[1] * g1, max(w[0] * w[0] * g0, w[1] * w[1] * g1), limit);
}
real multiplier(Constraint4 c, real w[4], real k, real limit) {
  real sum = real(0), longest = real(0);
  for (int j = 0; j < 4; ++j) {
    real g = w[j] * dot(c.gradient[j], c.gradient[j]);
    sum += g;
    longest = max(longest, w[j] * g);
  }
  return bounded(k * c.C, max(sum, c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3])), longest, limit);
}

// The guards that a multiplier took.
uint guards_of(Constraint2 c, real w[2], real k, real limit) {
  real g0 = dot(c.gradient[0], c.gradient[0]), g1 = dot(c.gradient[1], c.gradient[1]);
  return c.guards | guards_of(k * c.C, w[0] * g0 + w[1] * g1, max(w[0] * w[0] * g0, w[1] * w[1] * g1), limit);
}
uint guards_of(Constraint4 c, real w[4], real k, real limit) {
  real sum = real(0), longest = real(0);
  for (int j = 0; j < 4; ++j) {
    real g = w[j] * dot(c.gradient[j], c.gradient[j]);
    sum += g;
    longest = max(longest, w[j] * g);
  }
  real least = c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3]);
  return c.guards | (c.C != real(0) && sum < least ? GUARD_FLOOR : 0u) | guards_of(k * c.C, max(sum, least), longest, limit);
}
