// Each file of obstacles/ is a kind: its signed distance NAME_surface(), negative inside, which outside may be too
// short but not too long (method.md, "Obstacles with a shape"). GLSL and C++ (sim/model/formulas.h), where texel(i) is
// value i of the fields.
struct Solid {  // an obstacle in its own coordinates, as in ObstacleRecord (layout.glsl)
  int kind;
  int convex;
  vec3 extent;
  real radius;
  real trust;
  real spacing;
  vec3 origin;
  ivec3 cells;
  int first;
};

real side_of(real x) { return x < real(0) ? real(-1) : real(1); }
vec3 sides_of(vec3 p) { return vec3(side_of(p.x), side_of(p.y), side_of(p.z)); }
// The distance from three pairs of sides, of which a point is beyond the nearer ones by `past` in directions n0 to n2.
Surface beyond_sides(vec3 past, vec3 n0, vec3 n1, vec3 n2) {
  real most = max(past.x, max(past.y, past.z));
  if (most <= real(0)) return Surface(past.y == most ? n1 : past.x == most ? n0 : n2, most);
  vec3 away = max(past.x, real(0)) * n0 + max(past.y, real(0)) * n1 + max(past.z, real(0)) * n2;
  real l = length(away);
  return Surface(away / l, l);
}
// The distance of a point `away` from the nearest point of a box around the whole surface, where the distance is `s`:
// `away` and the direction to the surface are at no acute angle.
Surface outside(Surface s, vec3 away) {
  real inner = max(s.distance, real(0));
  vec3 n = away + inner * s.normal;
  return Surface(n / length(n), sqrt(dot(away, away) + inner * inner));
}
