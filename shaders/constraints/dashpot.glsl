// The dashpot of a viscous material (method.md eq. 25): C = |x0 - x1| in metres, of which only the change in a substep
// counts.
Constraint2 dashpot(vec3 x[2], real rest, Ids ids) {
  Constraint2 c;
  vec3 d = x[0] - x[1];
  real l = length(d);
  bool apart = l > real(1e-6) * rest;
  vec3 n = apart ? d / l : vec3(real(0));
  c.guards = apart ? 0u : GUARD_DIRECTION;
  c.C = l;
  c.gradient[0] = n;
  c.gradient[1] = -n;
  c.floor = real(0);
  return c;
}
