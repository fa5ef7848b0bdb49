// A fibre through a tet: C = l - rest[3] where it is longer than that, else 0; l is its stretch, the length of
// sum rest[j] (x_(j+1) - x0), which is the deformation of its direction at rest. rest[3] is 1, less its activation.
Constraint4 fibre(vec3 x[4], const real rest[5], Ids ids) {
  Constraint4 c;
  vec3 d1 = x[1] - x[0], d2 = x[2] - x[0], d3 = x[3] - x[0];
  vec3 f = rest[0] * d1 + rest[1] * d2 + rest[2] * d3;
  real l = length(f);
  bool taut = l > rest[3] && l > real(1e-6);
  vec3 n = taut ? f / l : vec3(real(0));
  real spread = abs(rest[0]) + abs(rest[1]) + abs(rest[2]);
  real noise = abs(rest[0]) * length(d1) + abs(rest[1]) * length(d2) + abs(rest[2]) * length(d3) +
               real(2) * spread * quantization_size;
  c.C = taut ? apply_dead_zone(l - rest[3], noise) : real(0);
  c.gradient[1] = rest[0] * n;
  c.gradient[2] = rest[1] * n;
  c.gradient[3] = rest[2] * n;
  c.gradient[0] = -(c.gradient[1] + c.gradient[2] + c.gradient[3]);
  c.floor = real(0);
  c.guards = 0u;
  return c;
}
// C Hess C: a taut fibre resists turning.
mat3 fibre_curvature(Constraint4 c, vec3 x[4], int i, int j) {
  vec3 gi = gradient_of(c, i), gj = gradient_of(c, j);
  real squared = dot(gi, gj), size = dot(gi, gi);
  vec3 n = size > real(0) ? gi / sqrt(size) : vec3(real(0));
  // The stretch, from what the gradient gives of it: sum g_k . x_k = n . f = l.
  real l = real(0);
  for (int k = 1; k < 4; ++k) l += dot(gradient_of(c, k), x[k] - x[0]);
  return (mat3(real(1)) - outerProduct(n, n)) * (size > real(0) ? squared * c.C / max(l, real(1e-6)) : real(0));
}
