// The candidates of each vertex of a surface or, with QUERY_EDGES, of each sharp edge: the nearest targets within the margin, of equally near ones
// those of the least number, so that the order in which they are found plays no part. One that is deep in a body looks as far as its surface. LANES
// invocations per item: a work-group, whose items are of one leaf, first tests targets of near leaves by their spheres, each invocation one of these
// against all items; then each looks at some of what passed for its item, and counts how much of the rest is nearer.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
#include "pairs/formulas.glsl"
#include "pairs/meeting.glsl"
#if CONTACT_SELF
layout(std430, binding = BIND_PAIR_REST) restrict readonly buffer PairRest { vec4 pair_rest[]; };  // places by vertex
// Of its own body an item meets what is not its neighbour at rest either; of a sheet, what it has no vertex in common with.
bool is_neighbour(uint s, uint t) {
  uvec4 vertices = vertices_of(s, t);
  float apart = thickness_of(item_body(s)) > 0.0 ? 0.0 : 2.4 * EDGE;
  uint own = item_is_edge(s) ? 2u : 1u;
  for (uint a = 0u; a < own; ++a)
    for (uint b = own; b < 4u; ++b)
      if (distance(pair_rest[vertices[a]].xyz, pair_rest[vertices[b]].xyz) <= apart) return true;
  return false;
}
#endif
#if QUERY_EDGES == 0
// Of the sum of the normals of the triangles around a vertex, one of LANES parts.
vec3 part_of_normal(uint s, uint lane) {
  vec3 sum = vec3(0.0), a = positions[surface_vertex(s)].high;
  for (uint k = pair_mesh[AROUND_AT + s] + 2u * lane; k < pair_mesh[AROUND_AT + s + 1u]; k += 2u * LANES) {
    vec3 n = cross(positions[pair_mesh[k]].high - a, positions[pair_mesh[k + 1u]].high - a);
    float area = length(n);
    if (area > 0.0) sum += n / area;
  }
  return sum;
}
#endif
// An item as it looks at targets.
struct Look {
  uint s, body, held;  // the target that it was in
  Pair own;            // where it is
  float radius;
  vec3 normal;  // of a vertex
};
const float nothing = 1e30;
// How far target t is, which is given its bits; nothing: it is no candidate.
#if QUERY_EDGES
float look_at(Look look, inout uint t) {
  uint s = look.s;
  Pair own = look.own;
  uvec4 vertices = vertices_of(s, t), beside = beside_of(s, t);
  vec3 p = from_own(vertices.y, own), q = from_own(vertices.z, own), r = from_own(vertices.w, own);
  vec3 left = from_own(beside.x, own), right = from_own(beside.y, own), other_left = from_own(beside.z, own), other_right = from_own(beside.w, own);
  float far = meet_edges(p, left, right, q, r, other_left, other_right).rank;
#if CONTACT_SELF
  if (target_body(t) == look.body && far > SELF_MARGIN) return nothing;
#endif
  return far <= look.radius && edges_oppose(p, left, right, q, r, other_left, other_right) ? far : nothing;
}
#else
float look_at(Look look, inout uint t) {
  Pair own = look.own;
  vec3 a = from_own(triangle_vertex(t, 0u), own), b = from_own(triangle_vertex(t, 1u), own), c = from_own(triangle_vertex(t, 2u), own);
  vec3 beyond = max(max(min(a, min(b, c)), -max(a, max(b, c))), vec3(0.0));
  bool has_sides = SHEETS != 0 && thickness_of(triangle_body(t)) > 0.0;  // one that was crossed comes first, however far it is
  if (!has_sides && dot(beyond, beyond) > 1.01 * look.radius * look.radius) return nothing;
  Meeting m = meet(a, b, c);
  bool opposed = opposes(m, look.normal);
#if CONTACT_SELF
  bool same_body = target_body(t) == look.body;
#endif
#if SHEETS
  if (has_sides) {  // that where the vertex is, or was before it went through
    bool under = dot(m.face, a) > 0.0, was_near = false;
    for (uint j = 0u; j < 3u && look.held != NONE; ++j)
      for (uint l = 0u; l < 3u; ++l) was_near = was_near || triangle_vertex(look.held & TARGET, j) == triangle_vertex(t, l);
    if (was_near) under = (look.held & UNDER) != 0u;
    if (under) t |= UNDER;
    m = meet_sheet(a, b, c, under);
    opposed = true;
  } else if (thickness_of(look.body) > 0.0) {
    opposed = true;
  }
#endif
#if CONTACT_SELF
  if (same_body && abs(m.gap) > SELF_MARGIN) return nothing;  // a thin part's other side is no contact
#endif
  if (!(m.rank <= look.radius)) return nothing;
  if (!opposed) t |= BESIDE;
  return m.rank;
}
#endif
#if LANES > 1
#define WAITING 96u  // at least LANES * CANDIDATES; of an item near which are more, each invocation keeps the CANDIDATES nearest that it finds
#else
#define WAITING 32u
#endif
#define MOST_PIECES 256u
shared uint lists[PER_GROUP * WAITING];  // targets near each item
shared float distances[PER_GROUP * WAITING];
shared uint nearest[PER_GROUP * CANDIDATES];  // of each item
shared uvec2 pieces[MOST_PIECES];             // first and end of near leaves' targets, by GROUP_SIZE
shared uint piece_count, waiting_count[PER_GROUP], items[PER_GROUP], found_count, first_record;
shared bool may_push[PER_GROUP];
shared vec4 balls[PER_GROUP];  // around what each item looks at: centre, radius, below 0 where there is none
#if QUERY_EDGES
uint first_target(uint leaf) { return TRIANGLES + of_leaf(leaf, 5u); }
uint end_of_targets(uint leaf) { return TRIANGLES + of_leaf(leaf, 6u); }
#define LEAVES_OF_GROUPS LEAF_OF_EDGE_GROUP
#else
shared vec3 normals[GROUP_SIZE];
uint first_target(uint leaf) { return of_leaf(leaf, 1u); }
uint end_of_targets(uint leaf) { return of_leaf(leaf, 2u); }
#define LEAVES_OF_GROUPS LEAF_OF_GROUP
#endif
// Whether item s, of that body, and target t may meet at all.
bool may_meet(uint s, uint t, uint body) {
#if QUERY_EDGES
  if (t <= TRIANGLES + s - SURFACE_VERTICES) return false;  // of two edges, the first looks for the second
#endif
#if CONTACT_SELF
  return target_body(t) != body || !is_neighbour(s, t);
#else
  return true;  // leaves of the same body are not looked through
#endif
}
bool is_near(vec4 ball, vec4 sphere) { return distance(sphere.xyz, ball.xyz) <= ball.w + 1.01 * sphere.w; }
// What invocations found of target t and each item.
void list_target(uint t, vec4 sphere, vec3 lowest, vec3 highest, uint body) {
  if (any(lessThan(sphere.xyz + 1.01 * sphere.w, lowest)) || any(greaterThan(sphere.xyz - 1.01 * sphere.w, highest))) return;
  for (uint p = 0u; p < PER_GROUP; ++p)
    if (is_near(balls[p], sphere) && may_meet(items[p], t, body)) {
      uint slot = atomicAdd(waiting_count[p], 1u);
      if (slot < WAITING) lists[p * WAITING + slot] = t;
    }
}
bool before(float d, uint t, uint slot) { return d < distances[slot] || (d == distances[slot] && t < lists[slot]); }
// Into the CANDIDATES nearest from a slot on.
void keep(uint first, uint t, float d) {
  for (uint slot = first; slot < first + CANDIDATES; ++slot) {
    if (!before(d, t, slot)) continue;
    uint t_out = lists[slot];
    float d_out = distances[slot];
    lists[slot] = t, distances[slot] = d;
    t = t_out, d = d_out;
  }
}
void main() {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  uint number = group_index() * PER_GROUP + part, own_leaf = pair_lists[LEAVES_OF_GROUPS + group_index()], body = of_leaf(own_leaf, 0u);
#if QUERY_EDGES
  uint s = number < pair_lists[NEAR_EDGES] ? pair_lists[NEAR_EDGES_AT + number] : NONE;
  bool there = s != NONE;
  if (!there) s = SURFACE_VERTICES;
  uint i = edge_vertex(s - SURFACE_VERTICES, 0u);
  vec3 end = positions[edge_vertex(s - SURFACE_VERTICES, 1u)].high;
#else
  uint s = number < pair_lists[NEAR_VERTICES] ? pair_lists[NEAR_AT + number] : NONE;
  bool there = s != NONE;
  if (!there) s = 0u;
  uint i = surface_vertex(s);
  vec3 end = positions[i].high;
#endif
  Pair own = Pair(positions[i].high, positions[i].low);
  uint held = there ? pair_lists[HELD + s] : NONE;
  float radius = held != NONE ? reach_of(uintBitsToFloat(pair_lists[DEPTHS + s])) : margin;
  vec4 ball = there ? vec4(0.5 * (own.high + end), 0.5 * distance(own.high, end) + 1.01 * radius) : vec4(vec3(0.0), -1e30);
  if (lane == 0u) waiting_count[part] = 0u, items[part] = s, balls[part] = ball, may_push[part] = false;
  for (uint k = lane; k < CANDIDATES; k += LANES) nearest[part * CANDIDATES + k] = NONE;
  if (gl_LocalInvocationIndex == 0u) piece_count = found_count = 0u;
  barrier();
  vec3 lowest = vec3(1e30), highest = vec3(-1e30);
  for (uint p = 0u; p < PER_GROUP; ++p)
    if (balls[p].w > 0.0) lowest = min(lowest, balls[p].xyz - balls[p].w), highest = max(highest, balls[p].xyz + balls[p].w);
  uint near = NEAR_LEAVES_AT + (NEAR_LEAVES + 1u) * own_leaf, near_count = pair_lists[near];
  bool all_leaves = near_count > NEAR_LEAVES;
  for (uint n = gl_LocalInvocationIndex; n < (all_leaves ? LEAVES : near_count); n += GROUP_SIZE) {
    uint l = all_leaves ? n : pair_lists[near + 1u + n], end = end_of_targets(l);
    if (!in_leaf(l, lowest, highest) || (CONTACT_SELF == 0 && all_leaves && of_leaf(l, 0u) == body)) continue;
    for (uint first = first_target(l); first < end; first += GROUP_SIZE) {
      uint slot = atomicAdd(piece_count, 1u);
      if (slot < MOST_PIECES) pieces[slot] = uvec2(first, min(first + GROUP_SIZE, end));
    }
  }
  barrier();
  uint listed_count = min(piece_count, MOST_PIECES);
  const uint at_once = 4u;  // what is read does not wait for each other
  for (uint n = 0u; n < listed_count; n += at_once) {
    uint targets[at_once];
    vec4 spheres[at_once];
    for (uint j = 0u; j < at_once; ++j) {
      uvec2 piece = pieces[min(n + j, listed_count - 1u)];
      uint t = piece.x + gl_LocalInvocationIndex;
      targets[j] = n + j < listed_count && t < piece.y ? t : NONE;
      spheres[j] = pair_spheres[min(t, TRIANGLES + EDGES - 1u)];
    }
    for (uint j = 0u; j < at_once; ++j)
      if (targets[j] != NONE) list_target(targets[j], spheres[j], lowest, highest, body);
  }
  barrier();
  bool listed = piece_count <= MOST_PIECES, any_waits = !listed;
  for (uint p = 0u; p < PER_GROUP; ++p) any_waits = any_waits || waiting_count[p] > 0u;
  if (!any_waits) {
    if (lane == 0u && there) pair_lists[HELD + s] = NONE;
    return;
  }
  vec3 normal = vec3(0.0);
#if QUERY_EDGES == 0
  normals[gl_LocalInvocationIndex] = there ? part_of_normal(s, lane) : vec3(0.0);
  barrier();
  for (uint k = part * LANES; k < (part + 1u) * LANES; ++k) normal += normals[k];
#endif
  Look look = Look(s, body, held, own, radius, normal);
  uint list = part * WAITING, count = waiting_count[part];
  if (listed && count <= WAITING) {
    for (uint slot = list + lane; slot < list + count; slot += LANES) {
      uint t = lists[slot];
      distances[slot] = look_at(look, t);
      lists[slot] = t;
    }
  } else {
    uint first = list + lane * CANDIDATES;
    for (uint slot = first; slot < first + CANDIDATES; ++slot) lists[slot] = NONE, distances[slot] = nothing;
    for (uint n = 0u; n < (!there ? 0u : listed ? listed_count : LEAVES); ++n) {
      if (!listed && CONTACT_SELF == 0 && of_leaf(n, 0u) == body) continue;
      uvec2 targets = listed ? pieces[n] : uvec2(first_target(n), end_of_targets(n));
      for (uint k = targets.x + lane; k < targets.y; k += LANES) {
        uint t = k;
        float d = nothing;
        if (is_near(ball, pair_spheres[t]) && may_meet(s, t, body)) d = look_at(look, t);
        if (d < nothing) keep(first, t, d);
      }
    }
    count = LANES * CANDIDATES;
  }
  barrier();
  for (uint slot = list + lane; slot < list + count; slot += LANES) {
    uint t = lists[slot], nearer = 0u;
    float d = distances[slot];
    if (!(d < nothing)) continue;
    for (uint other = list; other < list + count; ++other)
      if (other != slot && !before(d, t, other)) ++nearer;
    if (nearer >= CANDIDATES) continue;
    nearest[part * CANDIDATES + nearer] = t;
    if ((t & BESIDE) == 0u) may_push[part] = true;
  }
  barrier();
  uint record = lane == 0u && may_push[part] ? atomicAdd(found_count, 1u) : 0u;
  barrier();
  if (gl_LocalInvocationIndex == 0u && found_count > 0u) {
    first_record = atomicAdd(pair_lists[RECORDS], found_count);
    uint last = first_record + found_count - 1u;
    need_groups(GROUPS, last / GROUP_SIZE + 1u);
    need_groups(LANE_GROUPS, last / (GROUP_SIZE / CANDIDATES) + 1u);
  }
  barrier();
  if (lane == 0u && there) pair_lists[HELD + s] = NONE;
  if (lane != 0u || !may_push[part]) return;
  uint k = RECORDS_AT + RECORD * (first_record + record);
  pair_lists[k] = s;
  pair_lists[k + 2u] = 0u;
  for (uint c = 0u; c < CANDIDATES; ++c) pair_lists[k + CANDIDATE + c] = nearest[part * CANDIDATES + c];
}
