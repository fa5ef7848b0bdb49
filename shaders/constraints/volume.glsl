// Volume: C = V - rest in cubic metres, V = ((x1-x0) x (x2-x0)) . (x3-x0) / 6 signed, so that an inverted tet is pushed
// back (paper eqs. 16-21; method.md eq. 12).
Constraint4 volume(vec3 x[4], real rest, Ids ids) {
  Constraint4 c;
  vec3 a = x[1] - x[0];
  vec3 b = x[2] - x[0];
  vec3 d = x[3] - x[0];
  const real sixth = real(1) / real(6);
  c.gradient[1] = cross(b, d) * sixth;
  c.gradient[2] = cross(d, a) * sixth;
  c.gradient[3] = cross(a, b) * sixth;
  c.gradient[0] = -(c.gradient[1] + c.gradient[2] + c.gradient[3]);
  real side = sqrt(max(max(dot(a, a), dot(b, b)), dot(d, d)));  // the longest; the noise is that of a tet of such sides
  real noise = side * side * (side + real(3) * quantization_size);
  c.C = apply_dead_zone(dot(c.gradient[3], d) - rest, noise * sixth);
  c.guards = 0u;
  // The gradient vanishes where a tet collapses to a line. The floor, 0.7 % of a regular tet's at rest, keeps the
  // correction under about ten times the tet's size there.
  real area = pow(abs(rest), real(2) / real(3));
  c.floor = real(0.01) * area * area;
  real sum = real(0);
  for (int j = 0; j < 4; ++j) sum += dot(c.gradient[j], c.gradient[j]);
  if (sum <= real(1e-10) * c.floor) {
    // Vertices part two by two, so that momentum stays, in pseudo-random directions. Gradients are large, so that the
    // step is a few hundredths of the tet: it breaks the symmetry, and the true gradient takes over.
    c.gradient[0] = any_direction(id_of(ids, 0), id_of(ids, 1)) * (real(9) * area);
    c.gradient[1] = -c.gradient[0];
    c.gradient[2] = any_direction(id_of(ids, 2), id_of(ids, 3)) * (real(9) * area);
    c.gradient[3] = -c.gradient[2];
    c.guards = GUARD_COLLAPSED;
  }
  return c;
}
// The volume over the volume at rest.
real volume_jacobian(vec3 x[4], real rest) {
  return dot(cross(x[1] - x[0], x[2] - x[0]), x[3] - x[0]) / (real(6) * rest);
}
