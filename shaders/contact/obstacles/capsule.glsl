// The points within a radius of a part of the y axis.
Surface capsule_surface(Solid s, vec3 p) {
  vec3 arm = p - vec3(real(0), clamp(p.y, -s.extent.y, s.extent.y), real(0));
  real l = length(arm);
  return Surface(l > real(0) ? arm / l : vec3(real(1), real(0), real(0)), l - s.radius);
}
