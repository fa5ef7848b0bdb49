// Stretch: C = |x0 - x1| - rest, in metres (paper eqs. 4-5; method.md eq. 6).
// Coincident vertices have no direction: the gradient is zero and other constraints have to part them.
Constraint2 stretch(vec3 x[2], real rest) {
  Constraint2 c;
  vec3 d = x[0] - x[1];
  real l = length(d);
  vec3 n = l > real(1e-6) * rest ? d / l : vec3(real(0));
  c.C = resolved(l - rest, rest + grain);
  c.gradient[0] = n;
  c.gradient[1] = -n;
  c.floor = real(0);
  return c;
}
