// A vertex and a triangle of the surface of a body, all places relative to the vertex (method.md, "Bodies in contact").
struct Meeting {
  vec3 weights;  // of the corners, at the point nearest to the vertex
  vec3 normal;   // unit, out of the triangle's body, along which the vertex leaves it
  real gap;      // m, negative inside
  vec3 face;     // the triangle's own normal, unit
  real rank;     // by distance; of triangles as near as each other the sign of that which faces the vertex most is right, and comes first
};
// Weights of the corners at the point of a triangle that is nearest to the origin (Ericson 2005, Real-Time Collision Detection, 5.1.5).
vec3 nearest_weights(vec3 a, vec3 b, vec3 c) {
  vec3 ab = b - a, ac = c - a;
  real d1 = -dot(ab, a), d2 = -dot(ac, a), d3 = -dot(ab, b), d4 = -dot(ac, b), d5 = -dot(ab, c), d6 = -dot(ac, c);
  if (d1 <= real(0) && d2 <= real(0)) return vec3(1, 0, 0);
  if (d3 >= real(0) && d4 <= d3) return vec3(0, 1, 0);
  real vc = d1 * d4 - d3 * d2;
  if (vc <= real(0) && d1 >= real(0) && d3 <= real(0)) return vec3(real(1) - d1 / (d1 - d3), d1 / (d1 - d3), 0);
  if (d6 >= real(0) && d5 <= d6) return vec3(0, 0, 1);
  real vb = d5 * d2 - d1 * d6;
  if (vb <= real(0) && d2 >= real(0) && d6 <= real(0)) return vec3(real(1) - d2 / (d2 - d6), 0, d2 / (d2 - d6));
  real va = d3 * d6 - d5 * d4;
  if (va <= real(0) && d4 >= d3 && d5 >= d6) {
    real w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return vec3(0, real(1) - w, w);
  }
  real whole = va + vb + vc;
  return whole > real(0) ? vec3(va / whole, vb / whole, vc / whole) : vec3(1, 0, 0);
}
// A triangle without area meets nothing: gap is far, then.
Meeting meet(vec3 a, vec3 b, vec3 c) {
  Meeting m;
  m.weights = nearest_weights(a, b, c);
  vec3 n = cross(b - a, c - a), to = -(m.weights.x * a + m.weights.y * b + m.weights.z * c);
  real area = length(n), far = length(to);
  m.normal = vec3(0, 1, 0);
  m.gap = real(1e30);
  m.rank = real(1e30);
  m.face = m.normal;
  if (!(area > real(0))) return m;
  n /= area;
  m.face = n;
  real along = dot(to, n);
  // Inside, the nearest point is in a face, or on an edge that is all but flat or bent inwards; a stale triangle's edge says nothing.
  m.gap = along < real(-0.7) * far ? -far : far;
  m.rank = far - real(1e-3) * abs(along);
  // Beside the face, away from or towards the edge; a vertex on it has no such direction.
  bool beside = far > real(1e-6) * sqrt(area) && abs(along) < real(0.999999) * far;
  m.normal = beside ? to / m.gap : n;
  return m;
}
// Whether a vertex, with its normal of any length, can have come in through the triangle: those that look the same way are the far side of a thin part, or
// beside the rim of a face.
bool opposes(Meeting m, vec3 normal) { return dot(m.face, normal) < real(0.3) * length(normal); }
// How a vertex is to move relative to the triangle that it is in, whose `way` in this substep it went relative to it: what stops it and what friction
// takes back along the triangle changes its velocity as well; what is left of the depth, by `push` (m) at most, only its place, so that
// it gives no energy.
struct Stop {
  vec3 stopped;
  vec3 pushed;  // beside
};
Stop meeting_correction(Meeting m, vec3 way, real push, real friction) {
  Stop s;
  real normal_way = dot(way, m.normal), stop = normal_way < real(0) ? -normal_way : real(0), left = -m.gap;
  if (stop > left) stop = left;
  left -= stop;
  vec3 slip = way - m.normal * normal_way;
  real l = length(slip), grip = friction * stop;
  if (l > grip) slip *= grip / l;
  s.stopped = m.normal * stop - slip;
  left -= real(0.01) * push;  // so much may stay, for a contact that comes and goes never rests
  s.pushed = m.normal * (left < real(0) ? real(0) : left < push ? left : push);
  return s;
}
