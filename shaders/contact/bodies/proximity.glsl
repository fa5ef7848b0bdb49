// A vertex and a triangle, or two edges, of surfaces that keep a distance from each other (method.md, "Bodies in
// contact"). Distances have no sign: on which side one is of the other is a matter of how it came there.
struct Proximity {
  real weights[4];  // b: of the vertex, then of the triangle's corners, or of both edges' ends; their sum is 0
  vec3 turns[4];    // e: what friction adds along the normal, so that it turns nothing, as a part of it
  vec3 normal;      // unit, from the triangle or the second edge
  real distance;    // m
  int part;         // nearest of the triangle: 0 its face, 1 to 3 an edge, 4 to 6 a corner; of edges 0, if the nearest
                    // points are within both, else 1
};
Proximity no_proximity() {
  Proximity t;
  for (int k = 0; k < 4; ++k) {
    t.weights[k] = real(0);
    t.turns[k] = vec3(0);
  }
  t.normal = vec3(0, 1, 0);
  t.distance = real(1e30);
  t.part = 0;
  return t;
}
// The direction of `to`, from the nearest point of one to that of the other.
Proximity with_normal(Proximity t, vec3 to) {
  t.distance = length(to);
  if (t.distance > real(0)) t.normal = to / t.distance;
  return t;
}
// A vertex at the origin and a triangle a, b, c.
Proximity vertex_triangle_proximity(vec3 a, vec3 b, vec3 c) {
  Proximity t = no_proximity();
  vec3 w = nearest_weights(a, b, c);
  t.weights[0] = real(1);
  t.weights[1] = -w.x, t.weights[2] = -w.y, t.weights[3] = -w.z;
  bool x = w.x > real(0), y = w.y > real(0), z = w.z > real(0);
  t.part = x && y && z ? 0 : x && y ? 1 : y && z ? 2 : x && z ? 3 : x ? 4 : y ? 5 : 6;
  t = with_normal(t, -(w.x * a + w.y * b + w.z * c));
  // A pair of forces across the distance turns both bodies. Forces along the normal at the corners, by the gradients
  // of their barycentric coordinates across it, turn them back; on a triangle seen edge-on they would be too large.
  vec3 area = cross(b - a, c - a);
  real across = dot(t.normal, area);
  if (abs(across) > real(0.2) * length(area)) {
    t.turns[1] = cross(t.normal, c - b) * (t.distance / across);
    t.turns[2] = cross(t.normal, a - c) * (t.distance / across);
    t.turns[3] = cross(t.normal, b - a) * (t.distance / across);
  }
  return t;
}
// Edges from the origin to p and from q to r.
Proximity edge_edge_proximity(vec3 p, vec3 q, vec3 r) {
  Proximity t = no_proximity();
  vec3 e = r - q;
  real pp = dot(p, p), ee = dot(e, e), pe = dot(p, e), pq = dot(p, q), eq = dot(e, q), across = pp * ee - pe * pe;
  if (!(pp > real(0) && ee > real(0))) return t;
  // Ericson 2005, Real-Time Collision Detection, 5.1.9. Nearly parallel edges are left to their ends.
  bool is_skew = across > real(1e-6) * pp * ee;
  real s = is_skew ? (pq * ee - pe * eq) / across : real(0);
  bool within = is_skew && s > real(0) && s < real(1);
  s = clamp(s, real(0), real(1));
  real u = (pe * s - eq) / ee;
  within = within && u > real(0) && u < real(1);
  if (u < real(0)) {
    u = real(0);
    s = clamp(pq / pp, real(0), real(1));
  } else if (u > real(1)) {
    u = real(1);
    s = clamp((pq + pe) / pp, real(0), real(1));
  }
  t.part = within ? 0 : 1;
  t.weights[0] = real(1) - s, t.weights[1] = s, t.weights[2] = u - real(1), t.weights[3] = -u;
  t = with_normal(t, s * p - q - u * e);
  // As for triangles: along each edge it turns itself back, and what is left across both is shared.
  real lp = sqrt(pp), le = sqrt(ee), c = pe / (lp * le), most = max(real(0.1), real(1) - c * c);
  vec3 along_p = (p / lp - e * (c / le)) * (t.distance / (lp * most));
  vec3 along_e = (e / le - p * (c / lp)) * (t.distance / (le * most));
  t.turns[0] = -along_p, t.turns[1] = along_p, t.turns[2] = -along_e, t.turns[3] = along_e;
  return t;
}
// Whether a way `to` leads out of a surface from an edge or a vertex, and not past it to what lies `beside`: each way
// belongs to one part of the surface, so that no contact is counted twice.
bool leads_away(vec3 to, vec3 beside) { return dot(to, beside) <= real(1e-3) * length(to) * length(beside); }
