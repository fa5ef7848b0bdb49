// Along the y axis.
Surface cylinder_surface(Solid s, vec3 p) {
  real r = sqrt(p.x * p.x + p.z * p.z);
  vec3 around = r > real(0) ? vec3(p.x / r, real(0), p.z / r) : vec3(real(1), real(0), real(0));
  vec3 past = vec3(r - s.radius, abs(p.y) - s.extent.y, r - s.radius);
  return beyond_sides(past, around, vec3(real(0), side_of(p.y), real(0)), vec3(real(0)));
}
