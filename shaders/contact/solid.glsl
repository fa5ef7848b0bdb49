// What a kind of obstacle is described by, in its own coordinates, and what distances of several kinds need. Each
// file of obstacles/ is a kind: the signed distance NAME_surface(), negative inside, or a bound that is nowhere
// longer outside (method.md, "Obstacles with a shape"). GLSL and C++ (sim/model/formulas.h); texel(i): value i of the
// fields.
struct Solid {  // as in ObstacleRecord (layout.glsl)
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
// From the lengths by which a point is beyond each pair of sides, and the directions to these.
Surface beyond_sides(vec3 past, vec3 n0, vec3 n1, vec3 n2) {
  real most = max(past.x, max(past.y, past.z));
  if (most <= real(0)) return Surface(past.y == most ? n1 : past.x == most ? n0 : n2, most);
  vec3 way = max(past.x, real(0)) * n0 + max(past.y, real(0)) * n1 + max(past.z, real(0)) * n2;
  real l = length(way);
  return Surface(way / l, l);
}
// From the distance at the nearest point of a box that holds all of the surface, and the way from there: the angle
// between this way and that to the surface is no acute one.
Surface outside(Surface s, vec3 way) {
  real inner = max(s.distance, real(0));
  vec3 n = way + inner * s.normal;
  return Surface(n / length(n), sqrt(dot(way, way) + inner * inner));
}
