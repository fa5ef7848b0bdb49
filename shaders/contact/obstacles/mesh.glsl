// Distances at the points of a grid, trilinear between them; the normal is along the interpolant's gradient.
Surface mesh_surface(Solid s, vec3 p) {
  vec3 top = vec3(s.cells - ivec3(1)), q = (p - s.origin) / s.spacing, c = clamp(q, vec3(real(0)), top);
  ivec3 g = ivec3(min(floor(c), top - vec3(real(1))));
  vec3 f = c - vec3(g), e = vec3(real(1)) - f;
  int row = s.cells.x, layer = s.cells.x * s.cells.y, at = s.first + g.x + row * g.y + layer * g.z;
  real v000 = texel(at), v100 = texel(at + 1), v010 = texel(at + row), v110 = texel(at + row + 1);
  at += layer;
  real v001 = texel(at), v101 = texel(at + 1), v011 = texel(at + row), v111 = texel(at + row + 1);
  real y0 = e.x * v000 + f.x * v100, y1 = e.x * v010 + f.x * v110;
  real y2 = e.x * v001 + f.x * v101, y3 = e.x * v011 + f.x * v111;
  real z0 = e.y * y0 + f.y * y1, z1 = e.y * y2 + f.y * y3;
  real slope_x = e.z * (e.y * (v100 - v000) + f.y * (v110 - v010)) +
                 f.z * (e.y * (v101 - v001) + f.y * (v111 - v011));
  vec3 slope = vec3(slope_x, e.z * (y1 - y0) + f.z * (y3 - y2), z1 - z0);
  real l = length(slope);
  Surface here = Surface(l > real(0) ? slope / l : vec3(real(0), real(1), real(0)), e.z * z0 + f.z * z1);
  return q == c ? here : outside(here, (q - c) * s.spacing);
}
