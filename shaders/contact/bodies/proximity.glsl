// A vertex and a triangle, or two edges, of surfaces that keep a distance from each other (method.md, "Bodies in
// contact"). Distances have no sign: on which side one is of the other is a matter of how it came there.
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
// What a pair does in a substep (method.md eqs. 57-59). Ways are those of its vertices, in m; as a velocity times the
// substep's length is one, so is an impulse here in kg m.
#define PUSH_TO real(0.95)   // of the offset, that places keep; the rest is room to rest in
#define PUSH_PART real(0.5)  // of what is missing to that, made up in a substep
#define LEAST_GAP real(0.02) // of the offset, below which nothing moves on
#define GAP_PART real(0.9)   // of the gap, which both sides together may cross in a substep
#define REST_PART real(0.5)  // of a distance at rest, which the offset within a body may be at most
#define LEAST_PART real(0.1) // of the offset, which bodies that touch from the start keep
#define AHEAD real(3)        // substeps before which a pair that will touch gets its share
struct Meeting {
  real along;        // m, along the normal; below 0 they come nearer
  vec3 way;          // m, of one relative to the other
  vec3 slip;         // m, across the normal, with what turns add
  real weight;       // 1/kg
  real slip_weight;  // 1/kg
};
real approach(Proximity t, vec3 ways[4]) {
  real sum = real(0);
  for (int k = 0; k < 4; ++k) sum += t.weights[k] * dot(t.normal, ways[k]);
  return sum;
}
bool touches_soon(Proximity t, vec3 ways[4], real offset) {
  return t.distance + AHEAD * min(real(0), approach(t, ways)) < offset;
}
// The share of a vertex's mass that a pair asks for, in parts.
uint mass_share(Proximity t, int k) {
  return uint(clamp(round(real(255) * max(abs(t.weights[k]), length(t.turns[k]))), real(1), real(255)));
}
// `weights`: inverse masses, 1/kg, of the parts that are the pair's. `turns`: friction must turn nothing.
Meeting meet(Proximity t, vec3 ways[4], real weights[4], bool turns) {
  Meeting m = Meeting(approach(t, ways), vec3(0), vec3(0), real(0), real(0));
  for (int k = 0; k < 4; ++k) {
    m.weight += t.weights[k] * t.weights[k] * weights[k];
    m.way += t.weights[k] * ways[k];
    if (turns) m.slip += dot(t.normal, ways[k]) * t.turns[k];
  }
  m.slip += m.way;
  m.slip -= dot(m.slip, t.normal) * t.normal;
  real size = length(m.slip);
  for (int k = 0; k < 4; ++k) {
    real turn = turns && size > real(0) ? dot(t.turns[k], m.slip) / size : real(0);
    m.slip_weight += (t.weights[k] * t.weights[k] + turn * turn) * weights[k];
  }
  return m;
}
// The impulse that leaves no more approach than the gap takes, inelastic on the pair's parts of the masses, so that
// kinetic energy cannot rise; and that of friction per slip.
real stopping_impulse(Proximity t, Meeting m, real offset) {
  return max(real(0), -m.along - max(real(0), t.distance - offset)) / m.weight;
}
real slip_impulse(Meeting m, real stop, real friction) {
  real size = length(m.slip);
  return size > real(0) ? min(real(1) / m.slip_weight, friction * stop / size) : real(0);
}
vec3 impulse_on(int k, Proximity t, Meeting m, real stop, real grip, bool turns) {
  vec3 impulse = t.weights[k] * (stop * t.normal - grip * m.slip);
  if (turns) impulse -= grip * dot(t.turns[k], m.slip) * t.normal;
  return impulse;
}
// m, the least way along the normal that rigid bodies have after they meet `along` it, if so fast that in `fall`, m,
// gravity has little part in it, and with a gap of -`least`. A hundredth more decides for all pairs of a face alike.
real least_way(real along, real least, real fall, real restitution) {
  bool rebounds = restitution > real(0) && along < real(-2) * fall + real(1.01) * least;
  return rebounds ? -restitution * along : least;
}
// Per inverse mass, of places alone: what moves a pair that is too near apart, by so many offsets at most.
real push_apart(Proximity t, Meeting m, real offset, real limit) {
  real missing = PUSH_TO * offset - t.distance;
  return missing > real(0) ? min(PUSH_PART * missing, limit * offset) / m.weight : real(0);
}
// As a push turns what slips, a little of the velocities goes along: `way` after impulses.
vec3 push_turn(int k, Proximity t, vec3 way, real push) { return push / t.distance * dot(t.turns[k], way) * t.normal; }
// Of the way along its side's approach, how much a vertex may go: each side may cross a part of the gap, by how fast it
// comes. `sides`: the largest approach of each, in m.
real allowed_part(Proximity t, real offset, vec2 sides, int side, real own) {
  real both = sides.x + sides.y, most = GAP_PART * max(real(0), t.distance - LEAST_GAP * offset);
  real limit = both > most ? most * (side == 0 ? sides.x : sides.y) / both : own;
  return own > limit ? limit / own : real(1);
}
// Between two bodies with these coefficients.
real mean_of_surfaces(real a, real b) { return a == b ? a : sqrt(a * b); }
