// The rate of strain of a viscous tet (method.md eq. 26), of which only the change in a substep counts: rest[0] is the
// number of its part, five of shear, which are orthonormal, and then that of volume; rest[1] its volume at rest.
Constraint4 viscous(vec3 x[4], const real rest[2], Ids ids) {
  Constraint4 c;
  vec3 a = x[1] - x[0], b = x[2] - x[0], d = x[3] - x[0];
  vec3 slopes[4];
  slopes[1] = cross(b, d);
  slopes[2] = cross(d, a);
  slopes[3] = cross(a, b);
  slopes[0] = -(slopes[1] + slopes[2] + slopes[3]);
  // A tet that is nearly flat would have endless rates.
  real six_volumes = max(dot(slopes[3], d), real(0.3) * rest[1]);
  int part = int(rest[0] + real(0.5));
  real half_ = real(0.7071067811865476), sixth = real(0.4082482904638630);
  vec3 along = part == 0   ? vec3(half_, -half_, real(0))
               : part == 1 ? vec3(sixth, sixth, real(-2) * sixth)
               : part == 5 ? vec3(real(1))
                           : vec3(real(0));
  for (int j = 0; j < 4; ++j) {
    vec3 s = slopes[j] / six_volumes;
    vec3 across = part == 2   ? vec3(s.y, s.x, real(0))
                  : part == 3 ? vec3(real(0), s.z, s.y)
                  : part == 4 ? vec3(s.z, real(0), s.x)
                              : vec3(real(0));
    c.gradient[j] = along * s + half_ * across;
  }
  c.C = real(0);
  c.floor = real(0);
  c.guards = 0u;
  return c;
}
