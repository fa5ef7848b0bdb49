// A block without a bottom, whose top has bilinear heights H over a grid of x and z: (y - H) / sqrt(1 + |grad H|^2).
Surface height_field_surface(Solid s, vec3 p) {
  real dx = real(2) * s.extent.x / real(s.cells.x - 1), dz = real(2) * s.extent.z / real(s.cells.z - 1);
  real u = clamp((p.x + s.extent.x) / dx, real(0), real(s.cells.x - 1));
  real w = clamp((p.z + s.extent.z) / dz, real(0), real(s.cells.z - 1));
  int i = min(int(u), s.cells.x - 2), k = min(int(w), s.cells.z - 2), at = s.first + i + s.cells.x * k;
  u -= real(i);
  w -= real(k);
  real h00 = texel(at), h10 = texel(at + 1), h01 = texel(at + s.cells.x), h11 = texel(at + s.cells.x + 1);
  real near = h00 + u * (h10 - h00), far = h01 + u * (h11 - h01);
  real slope_x = ((h10 - h00) + w * ((h11 - h01) - (h10 - h00))) / dx, slope_z = (far - near) / dz;
  real steep = sqrt(real(1) + slope_x * slope_x + slope_z * slope_z);
  Surface top = Surface(vec3(-slope_x, real(1), -slope_z) / steep, (p.y - (near + w * (far - near))) / steep);
  vec3 past = abs(p) - s.extent, side = sides_of(p);
  if (max(past.x, past.z) > real(0))
    return outside(top, vec3(max(past.x, real(0)) * side.x, real(0), max(past.z, real(0)) * side.z));
  if (top.distance >= max(past.x, past.z)) return top;
  return past.x > past.z ? Surface(vec3(side.x, real(0), real(0)), past.x)
                         : Surface(vec3(real(0), real(0), side.z), past.z);
}
