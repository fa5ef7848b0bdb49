// A vertex x0 that is attached to a triangle: C is a coordinate of its way from where it belongs, in metres. It belongs
// to a point of the triangle's plane, x1 + rest[0] (x2 - x1) + rest[1] (x3 - x1), and rest[2] metres along its normal.
// rest[3] is the number of the coordinate. Three such constraints hold a vertex.
Constraint4 attach(vec3 x[4], const real rest[5], Ids ids) {
  Constraint4 c;
  vec3 a = x[2] - x[1], b = x[3] - x[1], d = x[0] - x[1];
  vec3 across = cross(a, b);
  real area = length(across);
  bool sound = area > real(1e-12) * (dot(a, a) + dot(b, b));
  vec3 n = sound ? across / area : vec3(real(0));
  vec3 axis = vec3(rest[3] < real(0.5) ? real(1) : real(0), abs(rest[3] - real(1)) < real(0.5) ? real(1) : real(0),
                   rest[3] > real(1.5) ? real(1) : real(0));
  vec3 turn = (axis - dot(axis, n) * n) * (sound ? rest[2] / area : real(0));
  real noise = length(d) + abs(rest[0]) * length(a) + abs(rest[1]) * length(b) + abs(rest[2]) +
               (real(2) + abs(rest[0]) + abs(rest[1])) * quantization_size;
  c.C = apply_dead_zone(dot(axis, d - rest[0] * a - rest[1] * b - rest[2] * n), noise);
  c.gradient[0] = axis;
  c.gradient[2] = -(rest[0] * axis + cross(b, turn));
  c.gradient[3] = -(rest[1] * axis + cross(turn, a));
  c.gradient[1] = -(c.gradient[0] + c.gradient[2] + c.gradient[3]);
  c.floor = real(0);
  c.guards = 0u;
  return c;
}
