// A vertex and a triangle, or two edges, of the surfaces of bodies (method.md, "Bodies in contact").
struct Contact {
  real weights[4];  // at the nearest points: of the vertex and the triangle's corners, which are negative, or of the
                    // ends of the first edge and those of the second, which are negative
  vec3 normal;      // unit, outwards from the second's body
  real gap;         // m, negative inside
  vec3 face;        // the triangle's own normal, unit
  real rank;        // m: the smaller the nearer; of equally near triangles the one that faces the vertex most, whose
                    // sign is right, has the smallest
  bool in_doubt;    // outside by its gap, but behind the triangle's plane beside one of its edges
};
// The weights of a triangle's corners at its point nearest to the origin (Ericson 2005, Real-Time Collision Detection,
// 5.1.5).
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
// Six times the volumes of a tet with the origin in place of each vertex in turn. None is negative if the origin is
// inside; else the least belongs to the vertex opposite the face through which one leaves the tet towards the origin.
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
Contact no_contact() {
  Contact m;
  for (int j = 0; j < 4; ++j) m.weights[j] = real(0);
  m.gap = m.rank = real(1e30);
  m.normal = m.face = vec3(0, 1, 0);
  m.in_doubt = false;
  return m;
}
// Of a vertex at the origin with a triangle; none if the triangle has no area.
Contact vertex_triangle_contact(vec3 a, vec3 b, vec3 c) {
  Contact m = no_contact();
  vec3 weights = nearest_weights(a, b, c);
  m.weights[0] = real(1);
  for (int j = 0; j < 3; ++j) m.weights[j + 1] = -weights[j];
  vec3 n = cross(b - a, c - a), to = -(weights.x * a + weights.y * b + weights.z * c);
  real area = length(n), far = length(to);
  if (!(area > real(0))) return m;
  n /= area;
  m.face = n;
  real along = dot(to, n);
  // Inside, the nearest point is in a face, or on an edge that is nearly flat or bent inwards. Other edges, of
  // candidates that are far by now, tell nothing.
  m.gap = along < real(-0.7) * far ? -far : far;
  m.in_doubt = along < real(-0.05) * far && m.gap > real(0);
  m.rank = far - real(1e-3) * abs(along);
  // Beside the face the normal is across its edge, but rounding decides its direction for a vertex on the edge.
  bool beside = far > real(1e-6) * sqrt(area) && abs(along) < real(0.999999) * far;
  m.normal = beside ? to / m.gap : n;
  return m;
}
// The contact `m` of a vertex with a triangle of a sheet, on whose back it belongs if it is `under`.
Contact vertex_sheet_contact(Contact m, vec3 a, vec3 b, vec3 c, bool under) {
  if (!(m.gap < real(1e29))) return m;
  vec3 to = -m.weights[1] * a - m.weights[2] * b - m.weights[3] * c;  // from the vertex
  real far = length(to);
  if (under) m.face = -m.face;
  bool crossed = dot(to, m.face) > real(0.7) * far;  // through the sheet, not beside its rim
  m.normal = crossed || !(far > real(0)) ? m.face : -to / far;
  m.gap = crossed ? -far : far;
  m.in_doubt = false;
  m.rank = crossed ? real(1e-3) * far : far;  // coming back goes before all other contacts
  return m;
}
// The outward normal, of any length, of an edge from the origin to p: `left` and `right` are the third vertices of its
// triangles, `left` that of the triangle which runs through the edge from the origin to p.
vec3 edge_normal(vec3 p, vec3 left, vec3 right) {
  vec3 a = cross(p, left), b = cross(right, p);
  return a * length(b) + b * length(a);
}
// Whether two such edges, the second from q to r, can cross each other: not if their normals point the same way.
bool edges_oppose(vec3 p, vec3 left, vec3 right, vec3 q, vec3 r, vec3 other_left, vec3 other_right) {
  vec3 n = edge_normal(p, left, right), other = edge_normal(r - q, other_left - q, other_right - q);
  return dot(n, other) < real(0.3) * length(n) * length(other);
}
// Of two such edges: as wedges that cross each other they are in contact if the nearest point of each is behind both
// triangles of the other.
Contact edge_edge_contact(vec3 p, vec3 left, vec3 right, vec3 q, vec3 r, vec3 other_left, vec3 other_right) {
  Contact m = no_contact();
  vec3 e = r - q, between = cross(p, e);
  real pp = dot(p, p), ee = dot(e, e), pe = dot(p, e), pq = dot(p, q), eq = dot(e, q), across = dot(between, between);
  if (!(pp > real(0) && ee > real(0))) return m;
  // Ericson 2005, 5.1.9. Nearly parallel edges are left to the contacts of their ends with triangles.
  bool is_skew = across > real(1e-3) * pp * ee;
  real s = is_skew ? (pq * ee - eq * pe) / across : real(0);
  // At their ends rounding would decide.
  bool in_both = is_skew && s > real(1e-3) && s < real(0.999);
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
// Whether a vertex with that normal, of any length, can have come in through the triangle: if both normals point the
// same way, the triangle is the far side of a thin part, or the vertex is beside the rim of a face.
bool opposes(Contact m, vec3 normal) { return dot(m.face, normal) < real(0.3) * length(normal); }
// Between two bodies with these coefficients.
real mean_friction(real a, real b) { return a == b ? a : sqrt(a * b); }
// The two parts of a correction of the relative position, m.
struct Stop {
  vec3 stopped;  // ends the approach, with friction, and changes the velocity as well
  vec3 pushed;   // takes away what is left of the depth, without a velocity and hence without adding energy
};
// `displacement`: relative, in this substep; `push`: the most that `pushed` may be, m.
Stop contact_correction(Contact m, vec3 displacement, real push, real friction) {
  Stop s;
  real along = dot(displacement, m.normal), stop = along < real(0) ? -along : real(0), left = -m.gap;
  if (stop > left) stop = left;
  left -= stop;
  vec3 slip = displacement - m.normal * along;
  real l = length(slip), grip = friction * stop;
  if (l > grip) slip *= grip / l;
  s.stopped = m.normal * stop - slip;
  left -= real(0.01) * push;  // this depth stays, because a contact that comes and goes never rests
  s.pushed = m.normal * (left < real(0) ? real(0) : left < push ? left : push);
  return s;
}
