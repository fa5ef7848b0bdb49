// A vertex and a triangle, or two edges, of the surfaces of bodies (method.md, "Bodies in contact").
struct Meeting {
  real weights[4];  // of the vertex and the corners, or of the ends of the first edge and of the second, at the nearest
                    // points; these below 0
  vec3 normal;      // unit, out of the second's body, along which the first leaves it
  real gap;         // m, negative inside
  vec3 face;        // the triangle's own normal, unit
  real rank;  // by distance; of triangles as near as each other the sign of that which faces the vertex most is right,
              // and comes first
  bool in_doubt;  // a triangle's edge is nearest and the vertex behind its plane, but gap is not below 0
};
// Weights of the corners at the point of a triangle that is nearest to the origin (Ericson 2005, Real-Time Collision
// Detection, 5.1.5).
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
// Volumes (x 6) of a tet with the origin in place of each vertex in turn: none is negative where the origin is inside;
// else the least belongs to the vertex across from the face that the origin is beyond.
struct Parts {
  real volumes[4];
};
Parts tet_parts(vec3 a, vec3 b, vec3 c, vec3 d) {
  Parts p;
  vec3 ab = cross(a, b);
  p.volumes[0] = dot(cross(b, c), d);
  p.volumes[1] = dot(cross(c, a), d);
  p.volumes[2] = dot(ab, d);
  p.volumes[3] = -dot(ab, c);
  return p;
}
// A vertex at the origin and a triangle. One without area meets nothing: gap is far, then.
Meeting meet(vec3 a, vec3 b, vec3 c) {
  Meeting m;
  vec3 weights = nearest_weights(a, b, c);
  m.weights[0] = real(1);
  for (int j = 0; j < 3; ++j) m.weights[j + 1] = -weights[j];
  vec3 n = cross(b - a, c - a), to = -(weights.x * a + weights.y * b + weights.z * c);
  real area = length(n), far = length(to);
  m.normal = vec3(0, 1, 0);
  m.gap = real(1e30);
  m.rank = real(1e30);
  m.face = m.normal;
  m.in_doubt = false;
  if (!(area > real(0))) return m;
  n /= area;
  m.face = n;
  real along = dot(to, n);
  // Inside, the nearest point is in a face, or on an edge that is all but flat or bent inwards; a stale triangle's edge
  // says nothing.
  m.gap = along < real(-0.7) * far ? -far : far;
  m.in_doubt = along < real(-0.05) * far && m.gap > real(0);
  m.rank = far - real(1e-3) * abs(along);
  // Beside the face, away from or towards the edge; a vertex on it has no such direction.
  bool beside = far > real(1e-6) * sqrt(area) && abs(along) < real(0.999999) * far;
  m.normal = beside ? to / m.gap : n;
  return m;
}
// A vertex at the origin and a triangle of a sheet, which has two sides; `under` says on which the vertex belongs.
Meeting meet_sheet(vec3 a, vec3 b, vec3 c, bool under) {
  Meeting m = meet(a, b, c);
  if (!(m.gap < real(1e29))) return m;
  vec3 to = -m.weights[1] * a - m.weights[2] * b - m.weights[3] * c;  // from the vertex
  real far = length(to);
  if (under) m.face = -m.face;
  bool crossed = dot(to, m.face) > real(0.7) * far;  // not beside its rim
  m.normal = crossed || !(far > real(0)) ? m.face : -to / far;
  m.gap = crossed ? -far : far;
  m.in_doubt = false;
  m.rank = crossed ? real(1e-3) * far : far;  // first of all it is to come back
  return m;
}
// Across the edge of two triangles, from the origin to p, out of the body; `left` is the third vertex of the triangle
// in which it goes that way.
vec3 edge_normal(vec3 p, vec3 left, vec3 right) {
  vec3 a = cross(p, left), b = cross(right, p);
  return a * length(b) + b * length(a);
}
// Whether two such edges, each with the place of its first end, can have come into each other: those that look the same
// way have not.
bool edges_oppose(vec3 p, vec3 left, vec3 right, vec3 q, vec3 r, vec3 other_left, vec3 other_right) {
  vec3 n = edge_normal(p, left, right), other = edge_normal(r - q, other_left - q, other_right - q);
  return dot(n, other) < real(0.3) * length(n) * length(other);
}
// Two edges, each with the third vertices of the triangles beside it; all places relative to the first end of the
// first. They are in each other where the nearest point of each is behind both triangles of the other, as where two
// wedges cross. Else gap is far.
Meeting meet_edges(vec3 p, vec3 left, vec3 right, vec3 q, vec3 r, vec3 other_left, vec3 other_right) {
  Meeting m;
  vec3 e = r - q, between = cross(p, e);
  real pp = dot(p, p), ee = dot(e, e), pe = dot(p, e), pq = dot(p, q), eq = dot(e, q), across = dot(between, between);
  m.gap = m.rank = real(1e30);
  m.normal = m.face = vec3(0, 1, 0);
  m.in_doubt = false;
  for (int j = 0; j < 4; ++j) m.weights[j] = real(0);
  if (!(pp > real(0) && ee > real(0))) return m;
  // Ericson 2005, 5.1.9. The ends of edges that are all but parallel meet triangles instead.
  bool cross_each_other = across > real(1e-3) * pp * ee;
  real s = cross_each_other ? (pq * ee - eq * pe) / across : real(0);
  // At their ends rounding would decide.
  bool in_both = cross_each_other && s > real(1e-3) && s < real(0.999);
  s = clamp(s, real(0), real(1));
  real t = (s * pe - eq) / ee;
  in_both = in_both && t > real(1e-3) && t < real(0.999);
  if (!(t > real(0) && t < real(1))) {
    t = t > real(0) ? real(1) : real(0);
    s = clamp((pq + t * pe) / pp, real(0), real(1));
  }
  m.weights[0] = real(1) - s;
  m.weights[1] = s;
  m.weights[2] = t - real(1);
  m.weights[3] = -t;
  vec3 to = q + t * e - s * p;
  m.rank = length(to);
  if (in_both && dot(to, cross(p, left)) < real(0) && dot(to, cross(right, p)) < real(0) &&
      dot(to, cross(e, other_left - q)) > real(0) && dot(to, cross(other_right - q, e)) > real(0)) {
    m.gap = -m.rank;
    m.normal = m.face = to / m.rank;
  }
  return m;
}
// Whether a vertex, with its normal of any length, can have come in through the triangle: those that look the same way
// are the far side of a thin part, or beside the rim of a face.
bool opposes(Meeting m, vec3 normal) { return dot(m.face, normal) < real(0.3) * length(normal); }
// Of two bodies with each other.
real mean_friction(real a, real b) { return a == b ? a : sqrt(a * b); }
// How a vertex is to move relative to the triangle that it is in, whose `way` in this substep it went relative to it:
// what stops it and what friction takes back along the triangle changes its velocity as well; what is left of the
// depth, by `push` (m) at most, only its place, so that it gives no energy.
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
