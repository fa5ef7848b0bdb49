Surface box_surface(Solid s, vec3 p) {
  vec3 side = sides_of(p);
  return beyond_sides(abs(p) - s.extent, vec3(side.x, real(0), real(0)), vec3(real(0), side.y, real(0)),
                      vec3(real(0), real(0), side.z));
}
