// Stretch: C = |x0 - x1| - rest, in metres (paper eqs. 4-5; method.md eq. 7).
// Coincident vertices have no direction, so they part along a pseudo-random one of their own.
Constraint2 stretch(vec3 x[2], real rest, Ids ids) {
  Constraint2 c;
  vec3 d = x[0] - x[1];
  real l = length(d);
  bool apart = l > real(1e-6) * rest;
  vec3 n = apart ? d / l : any_direction(id_of(ids, 0), id_of(ids, 1));
  c.guards = apart ? 0u : GUARD_DIRECTION;
  c.C = apply_dead_zone(l - rest, rest + quantization_size);
  c.gradient[0] = n;
  c.gradient[1] = -n;
  c.floor = real(0);
  return c;
}
// The positive part of C Hess C: a stretched edge resists turning. That of a compressed edge would not be positive.
mat3 stretch_curvature(Constraint2 c, vec3 x[2], int i, int j) {
  vec3 n = c.gradient[0];
  return (mat3(real(1)) - outerProduct(n, n)) * (-max(c.C, real(0)) / max(length(x[0] - x[1]), real(1e-30)));
}
