// What every constraint formula returns, and what a solver makes of it, as GLSL and as C++ (sim/model/formulas.h):
// `real` is float or double, and vec3 is of the same type. No formula returns early: at least one driver makes loops of
// that, which cost more than all the rest (docs/decisions.md).

// C and its gradient by each vertex. Guards alone ask for a vertex's number, id_of(ids, j).
struct Constraint2 {
  real C;
  vec3 gradient[2];
  real floor;   // of sum |gradient|^2 where the gradient can vanish with C still large, else 0
  uint guards;  // bits of layout.glsl's GUARD_*
};
struct Constraint4 {
  real C;
  vec3 gradient[4];
  real floor;
  uint guards;
};
// Two components that are solved together, C[k] and its gradient by each vertex.
struct Constraint4x2 {
  real C[2];
  vec3 gradient[2][4];
  uint guards;
};

// A block of a Hessian (mode newton; method.md eq. 36) is the gradient of vertex i by the position of j != i.
// Conditions choose what belongs to a vertex, because an array with a variable index would lie in memory.
vec3 chosen(int j, vec3 v0, vec3 v1, vec3 v2, vec3 v3) { return j == 0 ? v0 : j == 1 ? v1 : j == 2 ? v2 : v3; }
vec3 gradient_of(Constraint2 c, int j) { return j == 0 ? c.gradient[0] : c.gradient[1]; }
vec3 gradient_of(Constraint4 c, int j) { return chosen(j, c.gradient[0], c.gradient[1], c.gradient[2], c.gradient[3]); }
// matrix * p = cross(v, p)
mat3 cross_matrix(vec3 v) { return mat3(real(0), v.z, -v.y, -v.z, real(0), v.x, v.y, -v.x, real(0)); }

// What a constraint adds to an edge of mode newton's matrix: a block, and a force on i that is opposite on j.
struct EdgePart {
  mat3 block;
  vec3 force;
};

// What a constraint asks of one of its vertices in mode vbd: the gradient of its energy, and the diagonal block of the
// Hessian.
struct VertexPart {
  mat3 block;
  vec3 gradient;
};

// A unit vector for two vertices in one place, the opposite one for (b, a). It differs from that of other vertices, so
// that a body that has collapsed to a point does not unfold along a line only.
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

// An error C that rounding alone can make is none: rounding of 1e-9 m over a substep of 1e-6 s would be a velocity
// (method.md, "Rounding errors"). C is known to rounding * noise, and positions to rounding * quantization_size, which
// is 0 where they are kept in full.
real apply_dead_zone(real C, real noise) { return abs(C) <= real(4) * rounding * noise ? real(0) : C; }

struct Weighted {
  real sum;      // of w |grad C|^2 over the vertices, with inverse masses w
  real longest;  // w^2 |grad C|^2
  real least;    // what bounds the sum from below
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

// The multiplier of XPBD (Macklin, Mueller and Chentanez 2016; method.md eqs. 6, 17-18), and of PBD with a = 0 and
// share = 1. Vertex j moves by lambda w_j grad_j C, at most by max_correction.
struct Multiplier {
  real lambda;  // 0 where it is no number
  uint guards;  // those that triggered
};
// Here c.C is the whole residual, C + a lambda + gamma (C - C at the substep's start), with a = alpha / h^2 and gamma =
// tau / h. The relaxation in share = (1 + gamma) / omega leaves a alone, so that one iteration of a short substep is
// right too.
Multiplier bounded(real C, uint guards, Weighted s, real sum, real k, real max_correction) {
  real lambda = sum > real(0) ? -(k * C) / sum : real(0);
  real squared = lambda * lambda * s.longest;
  bool beyond = squared > max_correction * max_correction, number = squared * real(0) == real(0);
  if (beyond) lambda *= max_correction / sqrt(squared);
  if (C != real(0) && s.sum < s.least) guards |= GUARD_FLOOR;
  return Multiplier(number ? lambda : real(0), guards | (!number ? GUARD_NOT_FINITE : beyond ? GUARD_LIMIT : 0u));
}
Multiplier multiplier(Constraint2 c, real w[2], real k, real max_correction, real a, real share) {
  Weighted s = weighted(c, w);
  return bounded(c.C, c.guards, s, share * s.sum + a, k, max_correction);
}
Multiplier multiplier(Constraint4 c, real w[4], real k, real max_correction, real a, real share) {
  Weighted s = weighted(c, w);
  return bounded(c.C, c.guards, s, share * max(s.sum, s.least) + a, k, max_correction);
}

// The multipliers of two components (method.md eq. 23): (share grad C W grad C^T + a) lambda = -C, with the whole
// residual in c.C.
struct Multiplier2 {
  real lambda[2];
  uint guards;
};
Multiplier2 multiplier(Constraint4x2 c, real w[4], real max_correction, real a[2], real share) {
  real g00 = real(0), g01 = real(0), g11 = real(0), apart = real(0), longest = real(0);
  for (int j = 0; j < 4; ++j) {
    g00 += w[j] * dot(c.gradient[0][j], c.gradient[0][j]);
    g01 += w[j] * dot(c.gradient[0][j], c.gradient[1][j]);
    g11 += w[j] * dot(c.gradient[1][j], c.gradient[1][j]);
  }
  // The determinant without cancellation: at rest both gradients point the same way.
  real slope = g00 > real(0) ? g01 / g00 : real(0);
  for (int j = 0; j < 4; ++j) {
    vec3 rest = c.gradient[1][j] - slope * c.gradient[0][j];
    apart += w[j] * dot(rest, rest);
  }
  real unit = real(1) / (share * (g00 + g11) + a[0] + a[1]), b0 = a[0] * unit, b1 = a[1] * unit;
  g00 *= share * unit;
  g01 *= share * unit;
  g11 *= share * unit;
  real factor = -unit / (g00 * (apart * share * unit) + g00 * b1 + g11 * b0 + b0 * b1);
  Multiplier2 m;
  m.lambda[0] = factor * ((g11 + b1) * c.C[0] - g01 * c.C[1]);
  m.lambda[1] = factor * ((g00 + b0) * c.C[1] - g01 * c.C[0]);
  for (int j = 0; j < 4; ++j) {
    vec3 move = w[j] * (m.lambda[0] * c.gradient[0][j] + m.lambda[1] * c.gradient[1][j]);
    longest = max(longest, dot(move, move));
  }
  bool beyond = longest > max_correction * max_correction, number = longest * real(0) == real(0);
  real scale = number ? (beyond ? max_correction / sqrt(longest) : real(1)) : real(0);
  m.lambda[0] = number ? m.lambda[0] * scale : real(0);
  m.lambda[1] = number ? m.lambda[1] * scale : real(0);
  m.guards = c.guards | (!number ? GUARD_NOT_FINITE : beyond ? GUARD_LIMIT : 0u);
  return m;
}
// b of method.md eq. 34, times h^2. A stretched edge also resists being turned, in two directions, and edges of a
// squeezed body come to lie side by side. A tet that is turned over or nearly flat counts twice, for the curvature of
// its volume.
real stiffness_bound(Constraint2 c, vec3 x[2], real w[2], real a) {
  real l = length(x[0] - x[1]);
  return weighted(c, w).sum / a * (real(1) + real(2) * abs(c.C) / max(max(l, l - c.C), real(1e-30)));
}
real stiffness_bound(Constraint4 c, vec3 x[4], real w[4], real a) { return weighted(c, w).sum / a; }
real stiffness_bound(Constraint4x2 c, vec3 x[4], real w[4], const real a[2]) {
  real b = real(0);
  for (int j = 0; j < 4; ++j)
    b += w[j] * (dot(c.gradient[0][j], c.gradient[0][j]) / a[0] + dot(c.gradient[1][j], c.gradient[1][j]) / a[1]);
  return c.C[1] < real(-1) ? b + b : b;
}
