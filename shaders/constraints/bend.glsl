// Bending: C = angle - rest in radians, the signed dihedral angle of two triangles that share the edge x2 -> x3, with
// wings x0 and x1 (paper eqs. 6-15 with the sign that arccos loses; method.md eqs. 8-10).

// The atan of sine and cosine is exact to 2e-7 rad near flat, where arccos in float is wrong by 5e-4 and its derivative
// divides by zero.
real hinge_angle(vec3 x[4]) {
  vec3 e = x[3] - x[2];
  vec3 n0 = cross(x[2] - x[0], x[3] - x[0]);
  vec3 n1 = cross(x[3] - x[1], x[2] - x[1]);
  return atan(dot(cross(n0, n1), e), length(e) * dot(n0, n1));
}

Constraint4 bend(vec3 x[4], real rest, Ids ids) {
  Constraint4 c;
  vec3 e = x[3] - x[2];
  vec3 n0 = cross(x[2] - x[0], x[3] - x[0]);
  vec3 n1 = cross(x[3] - x[1], x[2] - x[1]);
  real ee = dot(e, e);
  real aa = dot(n0, n0);
  real bb = dot(n1, n1);
  real tiny = real(1e-12) * ee * ee;  // a wing closer to the edge than 1e-6 of its length has no angle
  bool sound = aa > tiny && bb > tiny;
  real turn = hinge_angle(x) - rest;
  const real pi = real(3.14159265358979323846);
  if (turn > pi) turn -= real(2) * pi;
  if (turn <= -pi) turn += real(2) * pi;
  real l = sqrt(ee);
  vec3 a = n0 / (sound ? aa : real(1));
  vec3 b = n1 / (sound ? bb : real(1));
  vec3 u = e / (sound ? l : real(1));
  // Sides are differences of positions relative to x0, so each is known to rounding times the hinge's extent, and a
  // normal's direction to that times a side over the normal's length.
  vec3 a2 = x[2] - x[0], a3 = x[3] - x[0], b0 = x[1] - x[0], b2 = x[2] - x[1], b3 = x[3] - x[1];
  real a22 = dot(a2, a2), a33 = dot(a3, a3), b22 = dot(b2, b2), b33 = dot(b3, b3);
  real longest = max(max(max(a22, a33), max(b22, b33)), dot(b0, b0));
  real noise = pi + real(4) * (longest + quantization_size * sqrt(longest)) / (sound ? sqrt(min(aa, bb)) : real(1));
  // An angle more than 1 rad off is brought back in several iterations: projecting all of it at k = 1 can diverge even
  // in double precision.
  c.C = sound ? clamp(apply_dead_zone(turn, noise), real(-1), real(1)) : real(0);
  c.guards = !sound ? GUARD_HINGE : abs(turn) > real(1) ? GUARD_ANGLE : 0u;
  c.floor = real(0);
  c.gradient[0] = -l * a;
  c.gradient[1] = -l * b;
  c.gradient[2] = -a * dot(x[0] - x[3], u) - b * dot(x[1] - x[3], u);
  c.gradient[3] = -a * dot(x[2] - x[0], u) - b * dot(x[2] - x[1], u);
  return c;
}
