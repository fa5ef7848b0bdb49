// Isometric bending (Bergou and others 2006) of wings x0 and x1 about the edge x2 -> x3: C = +-|L| - its value at rest,
// L = sum k_j x_j, without unit. The k add up to 0 and do not change, so C^2 / 2 is quadratic in x where the rest shape
// is flat. By the sign only one of two mirrored shapes is at rest, as in cubic shells (Garg and others 2007).

// `rest` has the weights k of x1, x2 and x3, which cotangents at rest give (constraint_kinds.h), and +-|L| there.
Constraint4 isobend(vec3 x[4], const real rest[4], Ids ids) {
  Constraint4 c;
  vec3 d1 = x[1] - x[0], d2 = x[2] - x[0], d3 = x[3] - x[0];
  vec3 L = rest[0] * d1 + rest[1] * d2 + rest[2] * d3;
  real l = length(L), k0 = -(rest[0] + rest[1] + rest[2]);
  real spread = sqrt(k0 * k0 + rest[0] * rest[0] + rest[1] * rest[1] + rest[2] * rest[2]);
  real noise =
      abs(rest[0]) * length(d1) + abs(rest[1]) * length(d2) + abs(rest[2]) * length(d3) + spread * quantization_size;
  // Where the hinge is flat, L has no direction, and the hinge bends across the surface.
  vec3 across = cross(d3 - d2, d1);
  real area = length(across);
  bool bent = l > real(4) * rounding * noise, sound = bent || area > real(0);
  bool other_way = bent && dot(L, across) < real(0);
  if (other_way) l = -l;
  vec3 n = bent ? L / l : sound ? across / area : any_direction(id_of(ids, 0), id_of(ids, 1));
  c.C = apply_dead_zone(l - rest[3], noise);
  c.guards = sound ? 0u : GUARD_HINGE;
  c.floor = real(0);
  c.gradient[0] = k0 * n;
  c.gradient[1] = rest[0] * n;
  c.gradient[2] = rest[1] * n;
  c.gradient[3] = rest[2] * n;
  return c;
}
