// What every constraint formula returns. GLSL and C++ (sim/formulas.h): `real` is float or double, vec3 follows it.
// C and its gradient by each vertex; `floor` bounds sum |gradient|^2 from below where the gradient can vanish
// with C still large (same unit as |gradient|^2; 0 where it cannot); `guards`: bits of layout.glsl's GUARD_*.
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

// lambda / k (method.md eq. 4). 0 where nothing can move.
real multiplier(Constraint2 c, real w[2]) {
  real sum = w[0] * dot(c.gradient[0], c.gradient[0]) + w[1] * dot(c.gradient[1], c.gradient[1]);
  return sum > real(0) ? -c.C / sum : real(0);
}
real multiplier(Constraint4 c, real w[4]) {
  real sum = real(0);
  for (int j = 0; j < 4; ++j) sum += w[j] * dot(c.gradient[j], c.gradient[j]);
  sum = max(sum, c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3]));
  return sum > real(0) ? -c.C / sum : real(0);
}

// The guards that a multiplier took.
uint guards_of(Constraint2 c, real w[2]) { return c.guards; }
uint guards_of(Constraint4 c, real w[4]) {
  real sum = real(0);
  for (int j = 0; j < 4; ++j) sum += w[j] * dot(c.gradient[j], c.gradient[j]);
  return c.C != real(0) && sum < c.floor * real(0.25) * (w[0] + w[1] + w[2] + w[3]) ? c.guards | GUARD_FLOOR : c.guards;
}

// No single correction moves a vertex by more than `limit` (one body size); a correction that is not a number moves nothing.
vec3 limited(vec3 correction, real limit) {
  real squared = dot(correction, correction);
  if (squared <= limit * limit) return correction;
  return squared > real(0) && squared * real(0) == real(0) ? correction * (limit / sqrt(squared)) : vec3(real(0));
}
uint guards_of(vec3 correction, real limit) {
  real squared = dot(correction, correction);
  if (squared <= limit * limit) return 0u;
  return squared * real(0) == real(0) ? GUARD_LIMIT : GUARD_NOT_FINITE;
}
