// Isometric bending (Bergou and others 2006) of wings x0 and x1 about the edge x2 -> x3: C = +-|L| - its value at rest,
// L = sum k_j x_j, without unit. The k add up to 0 and do not change, so C^2 / 2 is quadratic in x where the rest shape
// is flat. By the sign only one of two mirrored shapes is at rest, as in cubic shells (Garg and others 2007).

// `rest` is IsobendRest's values.
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

// The weights k of x1, x2 and x3, by the cotangents at rest, and +-|L| there. A wing without area has no weights: the
// constraint of such a hinge does nothing.
struct IsobendRest {
  real values[4];
};
real cotangent(vec3 u, vec3 v) { return dot(u, v) / length(cross(u, v)); }
IsobendRest isobend_rest(vec3 x[4], Ids ids) {
  vec3 e = x[3] - x[2];
  real twice_areas = length(cross(x[2] - x[0], x[3] - x[0])) + length(cross(x[2] - x[1], x[3] - x[1]));
  real scale = sqrt(real(6) / twice_areas);
  real c21 = cotangent(x[1] - x[2], e), c31 = cotangent(x[1] - x[3], -e);
  IsobendRest r;
  r.values[0] = -scale * (c21 + c31);
  r.values[1] = scale * (cotangent(x[0] - x[3], -e) + c31);
  r.values[2] = scale * (cotangent(x[0] - x[2], e) + c21);
  real sum = r.values[0] + r.values[1] + r.values[2];
  bool sound = sum * real(0) == real(0);
  for (int j = 0; j < 3; ++j) r.values[j] = sound ? r.values[j] : real(0);
  r.values[3] = real(0);
  real at_rest = isobend(x, r.values, ids).C;
  r.values[3] = sound ? at_rest : real(0);
  return r;
}
