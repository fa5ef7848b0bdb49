// Signed distances of obstacles (method.md, "Shapes"), negative inside, in a shape's own coordinates, and where a point that moves meets
// one. GLSL and C++ (sim/formulas.h); texel(i): value i of the fields.
struct Solid {  // as in Shape (layout.glsl)
  int kind;
  vec3 extent;
  real radius;
  real trust;
  real spacing;
  vec3 origin;
  ivec3 cells;
  int first;
};

vec3 sides_of(vec3 p) { return vec3(p.x < real(0) ? real(-1) : real(1), p.y < real(0) ? real(-1) : real(1), p.z < real(0) ? real(-1) : real(1)); }
// From the lengths by which a point is beyond each pair of sides, and the directions to these.
Surface beyond_sides(vec3 past, vec3 n0, vec3 n1, vec3 n2) {
  real most = max(past.x, max(past.y, past.z));
  if (most <= real(0)) return Surface(past.y == most ? n1 : past.x == most ? n0 : n2, most);
  vec3 way = max(past.x, real(0)) * n0 + max(past.y, real(0)) * n1 + max(past.z, real(0)) * n2;
  real l = length(way);
  return Surface(way / l, l);
}
Surface box_surface(vec3 p, vec3 extent) {
  vec3 s = sides_of(p);
  return beyond_sides(abs(p) - extent, vec3(s.x, real(0), real(0)), vec3(real(0), s.y, real(0)), vec3(real(0), real(0), s.z));
}
// A point, or a part of the y axis, with a radius.
Surface round_surface(vec3 p, real half_length, real radius) {
  vec3 arm = p - vec3(real(0), clamp(p.y, -half_length, half_length), real(0));
  real l = length(arm);
  return Surface(l > real(0) ? arm / l : vec3(real(1), real(0), real(0)), l - radius);
}
Surface cylinder_surface(vec3 p, real half_length, real radius) {
  real r = sqrt(p.x * p.x + p.z * p.z);
  vec3 around = r > real(0) ? vec3(p.x / r, real(0), p.z / r) : vec3(real(1), real(0), real(0));
  vec3 along = vec3(real(0), p.y < real(0) ? real(-1) : real(1), real(0));
  return beyond_sides(vec3(r - radius, abs(p.y) - half_length, r - radius), around, along, vec3(real(0)));
}
// From a distance at the nearest point of a box that holds all of the surface, and the way from there: the angle between this way and that to
// the surface is no acute one.
Surface outside(Surface s, vec3 way) {
  real inner = max(s.distance, real(0));
  vec3 n = way + inner * s.normal;
  return Surface(n / length(n), sqrt(dot(way, way) + inner * inner));
}
// Bilinear heights: (y - H) / sqrt(1 + |grad H|^2). A block whose top they are, without a bottom.
Surface heights_surface(Solid s, vec3 p) {
  real dx = real(2) * s.extent.x / real(s.cells.x - 1), dz = real(2) * s.extent.z / real(s.cells.z - 1);
  real u = clamp((p.x + s.extent.x) / dx, real(0), real(s.cells.x - 1)), w = clamp((p.z + s.extent.z) / dz, real(0), real(s.cells.z - 1));
  int i = min(int(u), s.cells.x - 2), k = min(int(w), s.cells.z - 2), at = s.first + i + s.cells.x * k;
  u -= real(i);
  w -= real(k);
  real h00 = texel(at), h10 = texel(at + 1), h01 = texel(at + s.cells.x), h11 = texel(at + s.cells.x + 1);
  real near = h00 + u * (h10 - h00), far = h01 + u * (h11 - h01);
  real slope_x = ((h10 - h00) + w * ((h11 - h01) - (h10 - h00))) / dx, slope_z = (far - near) / dz;
  real steep = sqrt(real(1) + slope_x * slope_x + slope_z * slope_z);
  Surface top = Surface(vec3(-slope_x, real(1), -slope_z) / steep, (p.y - (near + w * (far - near))) / steep);
  vec3 past = abs(p) - s.extent, side = sides_of(p);
  if (max(past.x, past.z) > real(0)) return outside(top, vec3(max(past.x, real(0)) * side.x, real(0), max(past.z, real(0)) * side.z));
  if (top.distance >= max(past.x, past.z)) return top;
  return past.x > past.z ? Surface(vec3(side.x, real(0), real(0)), past.x) : Surface(vec3(real(0), real(0), side.z), past.z);
}
// Trilinear distances; the normal is along the interpolant's gradient.
Surface grid_surface(Solid s, vec3 p) {
  vec3 top = vec3(s.cells - ivec3(1)), q = (p - s.origin) / s.spacing, c = clamp(q, vec3(real(0)), top);
  ivec3 g = ivec3(min(floor(c), top - vec3(real(1))));
  vec3 f = c - vec3(g), e = vec3(real(1)) - f;
  int row = s.cells.x, layer = s.cells.x * s.cells.y, at = s.first + g.x + row * g.y + layer * g.z;
  real v000 = texel(at), v100 = texel(at + 1), v010 = texel(at + row), v110 = texel(at + row + 1);
  at += layer;
  real v001 = texel(at), v101 = texel(at + 1), v011 = texel(at + row), v111 = texel(at + row + 1);
  real y0 = e.x * v000 + f.x * v100, y1 = e.x * v010 + f.x * v110, y2 = e.x * v001 + f.x * v101, y3 = e.x * v011 + f.x * v111;
  real z0 = e.y * y0 + f.y * y1, z1 = e.y * y2 + f.y * y3;
  vec3 slope = vec3(e.z * (e.y * (v100 - v000) + f.y * (v110 - v010)) + f.z * (e.y * (v101 - v001) + f.y * (v111 - v011)),
                    e.z * (y1 - y0) + f.z * (y3 - y2), z1 - z0);
  real l = length(slope);
  Surface here = Surface(l > real(0) ? slope / l : vec3(real(0), real(1), real(0)), e.z * z0 + f.z * z1);
  return q == c ? here : outside(here, (q - c) * s.spacing);
}
Surface surface_of(Solid s, vec3 p) {
  if (s.kind == SHAPE_BOX) return box_surface(p, s.extent);
  if (s.kind == SHAPE_CYLINDER) return cylinder_surface(p, s.extent.y, s.radius);
  if (s.kind == SHAPE_HEIGHTS) return heights_surface(s, p);
  if (s.kind == SHAPE_GRID) return grid_surface(s, p);
  if (s.kind == SHAPE_PLANE) return Surface(vec3(real(0), real(1), real(0)), p.y);
  return round_surface(p, s.extent.y, s.radius);
}

// The plane that a point meets on its straight way `from`, `to`, and the distance of `to` from it: negative where it would be stopped. Where
// it meets nothing, that of the nearest point of the surface.
// Convex shapes lie behind the plane at their nearest point, so the search goes from plane to plane (Newton's method); others are searched
// in steps of the distance, half a cell at least.
Surface meeting(Solid s, vec3 from, vec3 to) {
  vec3 way = to - from;
  real l = length(way), least = max(real(0.5) * s.spacing, l / real(64)), close = real(1e-3) * l + real(4) * rounding * length(from), t = real(0);
  bool convex = s.kind < SHAPE_HEIGHTS, hit = false, on = true;
  Surface here = Surface(vec3(real(0)), real(0)), end = here, plane = here;
  for (int turn = 0; turn < 66 && on; ++turn) {  // the start, the end, then the way: a single call, which is long
    Surface found = surface_of(s, turn == 1 ? to : from + t * way);
    if (turn == 1) end = found;
    else here = found;
    if (turn == 0) {
      on = here.distance * s.trust <= l;
      end = Surface(here.normal, here.distance + dot(here.normal, way));
    } else {
      if (here.distance <= (convex ? close : real(0))) {
        plane = Surface(here.normal, here.distance + dot(here.normal, way) * (real(1) - t));
        hit = plane.distance < real(0);
        on = !hit && !convex;
      }
      real approach = -dot(here.normal, way);
      on = on && l > real(0) && (!convex || approach > real(0));
      if (on) t += convex ? here.distance / approach : max(here.distance * s.trust, least) / l;
      on = on && t < real(1);
    }
  }
  // Inside, the nearest point is better known than a plane, but only on the same side.
  if (hit && !(end.distance < real(0) && dot(end.normal, plane.normal) > real(0.5))) return plane;
  return end;
}
