// A vertex and a triangle of the surface of a body, all places relative to the vertex (method.md, "Bodies in contact").
struct Meeting {
  vec3 weights;  // of the corners, at the point nearest to the vertex
  vec3 normal;   // unit, out of the triangle's body, along which the vertex leaves it
  real gap;      // m, negative inside
  real faces;    // how far the face looks at the vertex: of triangles as near as each other, the sign of the first is right
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
  m.faces = real(0);
  if (!(area > real(0))) return m;
  n /= area;
  real along = dot(to, n);
  m.gap = along < real(0) ? -far : far;
  m.faces = abs(along);
  // Beside the face, away from or towards the edge; a vertex on it has no such direction.
  bool beside = far > real(1e-6) * sqrt(area) && abs(along) < real(0.999999) * far;
  m.normal = beside ? to / m.gap : n;
  return m;
}
bool nearer(Meeting a, Meeting b) {
  real x = abs(a.gap), y = abs(b.gap);
  if (x < real(0.9999) * y) return true;
  return x <= y * real(1.0001) && a.faces > b.faces;
}
// How a vertex is to move relative to the triangle that it is in: out of it by the depth, but not faster than it came and `push` (m in this
// substep), and what friction takes back of its way along it. `way`: of this substep, relative to the triangle.
vec3 meeting_correction(Meeting m, vec3 way, real push, real friction) {
  real normal_way = dot(way, m.normal);
  real out_by = -m.gap, most = push - (normal_way < real(0) ? normal_way : real(0));
  if (out_by > most) out_by = most;
  vec3 slip = way - m.normal * normal_way;
  real l = length(slip), grip = friction * out_by;
  if (l > grip) slip *= grip / l;
  return m.normal * out_by - slip;
}
