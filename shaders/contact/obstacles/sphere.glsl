Surface sphere_surface(Solid s, vec3 p) {
  real l = length(p);
  return Surface(l > real(0) ? p / l : vec3(real(1), real(0), real(0)), l - s.radius);
}
