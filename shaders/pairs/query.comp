// The candidates of each vertex of a surface or, with QUERY_EDGES, of each sharp edge: the nearest targets within the margin, of equally near ones
// those of the least number, so that the order in which they are found plays no part. One that is deep in a body looks as far as its surface. LANES
// invocations per item: a work-group, whose items are of one leaf, first lists the targets near it; then each invocation tests some of these by their
// spheres, looks at some that pass, and lists are merged.
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
  vec3 sum = vec3(0.0);
  for (uint k = pair_mesh[AROUND_AT + s] + lane; k < pair_mesh[AROUND_AT + s + 1u]; k += LANES) {
    uint t = pair_mesh[k];
    vec3 a = positions[triangle_vertex(t, 0u)].high, n = cross(positions[triangle_vertex(t, 1u)].high - a, positions[triangle_vertex(t, 2u)].high - a);
    float area = length(n);
    if (area > 0.0) sum += n / area;
  }
  return sum;
}
#endif
uint found[CANDIDATES];
float distances[CANDIDATES];
void consider(uint t, float d) {
  for (uint k = 0u; k < CANDIDATES; ++k) {
    bool before = d < distances[k] || (d == distances[k] && t < found[k]);
    uint t_out = before ? found[k] : t;
    float d_out = before ? distances[k] : d;
    if (before) found[k] = t, distances[k] = d;
    t = t_out, d = d_out;
  }
}
// Item s, at `own`, that was in `held`, and target t, of the same body or not; `normal` is that of a vertex.
#if QUERY_EDGES
void look_at(uint s, uint t, bool same_body, Pair own, uint held, vec3 normal) {
  uvec4 vertices = vertices_of(s, t), beside = beside_of(s, t);
  vec3 p = from_own(vertices.y, own), q = from_own(vertices.z, own), r = from_own(vertices.w, own);
  vec3 left = from_own(beside.x, own), right = from_own(beside.y, own), other_left = from_own(beside.z, own), other_right = from_own(beside.w, own);
  float far = meet_edges(p, left, right, q, r, other_left, other_right).rank;
#if CONTACT_SELF
  if (same_body && far > SELF_MARGIN) return;
#endif
  if (far <= distances[CANDIDATES - 1u] && edges_oppose(p, left, right, q, r, other_left, other_right)) consider(t, far);
}
#else
void look_at(uint s, uint t, bool same_body, Pair own, uint held, vec3 normal) {
  vec3 a = from_own(triangle_vertex(t, 0u), own), b = from_own(triangle_vertex(t, 1u), own), c = from_own(triangle_vertex(t, 2u), own);
  vec3 beyond = max(max(min(a, min(b, c)), -max(a, max(b, c))), vec3(0.0));
  bool has_sides = SHEETS != 0 && thickness_of(triangle_body(t)) > 0.0;  // one that was crossed comes first, however far it is
  if (!has_sides && dot(beyond, beyond) > 1.01 * distances[CANDIDATES - 1u] * distances[CANDIDATES - 1u]) return;
  Meeting m = meet(a, b, c);
  bool opposed = opposes(m, normal);
#if SHEETS
  if (has_sides) {  // that where the vertex is, or was before it went through
    bool under = dot(m.face, a) > 0.0, was_near = false;
    for (uint j = 0u; j < 3u && held != NONE; ++j)
      for (uint l = 0u; l < 3u; ++l) was_near = was_near || triangle_vertex(held & TARGET, j) == triangle_vertex(t, l);
    if (was_near) under = (held & UNDER) != 0u;
    if (under) t |= UNDER;
    m = meet_sheet(a, b, c, under);
    opposed = true;
  } else if (thickness_of(surface_body(s)) > 0.0) {
    opposed = true;
  }
#endif
#if CONTACT_SELF
  if (same_body && abs(m.gap) > SELF_MARGIN) return;  // a thin part's other side is no contact
#endif
  if (m.rank <= distances[CANDIDATES - 1u]) consider(opposed ? t : t | BESIDE, m.rank);
}
#endif
// Shared memory is what limits how many work-groups run at once, so each word serves in turn.
#define STAGED (GROUP_SIZE * CANDIDATES)  // beyond, each item looks through the leaves itself
shared uint lists[STAGED], staged_count;  // parts of normals (as floats' bits); targets near the work-group's items; what each invocation found
#define MOST_LEAVES 768u                  // at least STAGED; if more are near, items look through all
shared uint scratch[MOST_LEAVES], leaf_count;  // near leaves; what waits to be looked at, of each item; how far what is in lists is (floats' bits)
#if LANES > 1
#define WAITING (MOST_LEAVES / PER_GROUP)  // more are looked at as they are found, by lanes that wait for each other
shared uint waiting_count[PER_GROUP];
// Leaves the nearest of all lists in that of the first lane.
void merge(uint lane) {
  for (uint half_size = LANES / 2u; half_size > 0u; half_size /= 2u) {
    barrier();
    uint own = gl_LocalInvocationIndex * CANDIDATES, other = own + half_size * CANDIDATES;
    for (uint k = 0u; k < CANDIDATES; ++k) lists[own + k] = found[k], scratch[own + k] = floatBitsToUint(distances[k]);
    barrier();
    if (lane < half_size)
      for (uint k = 0u; k < CANDIDATES; ++k)
        if (lists[other + k] != NONE && uintBitsToFloat(scratch[other + k]) <= distances[CANDIDATES - 1u])
          consider(lists[other + k], uintBitsToFloat(scratch[other + k]));
  }
}
#endif
shared vec3 lows[PER_GROUP], highs[PER_GROUP];  // of what each item looks at
#define BODY_WORDS ((BODY_COUNT + 31u) / 32u)
shared uint near_bodies[BODY_WORDS], own_body;  // a bit per body; the body of this work-group's items
#if QUERY_EDGES
uint first_target(uint leaf) { return TRIANGLES + of_leaf(leaf, 5u); }
uint end_of_targets(uint leaf) { return TRIANGLES + of_leaf(leaf, 6u); }
#else
uint first_target(uint leaf) { return of_leaf(leaf, 1u); }
uint end_of_targets(uint leaf) { return of_leaf(leaf, 2u); }
#endif
void main() {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  uint number = group_index() * PER_GROUP + part;
#if QUERY_EDGES
  uint s = number < pair_lists[NEAR_EDGES] ? pair_lists[NEAR_EDGES_AT + number] : NONE;
  bool there = s != NONE;
  if (!there) s = SURFACE_VERTICES;
  uint e = s - SURFACE_VERTICES, i = edge_vertex(e, 0u), body = edge_body(e);
  vec3 end = positions[edge_vertex(e, 1u)].high, low = min(positions[i].high, end), high = max(positions[i].high, end);
#else
  uint s = number < pair_lists[NEAR_VERTICES] ? pair_lists[NEAR_AT + number] : NONE;
  bool there = s != NONE;
  if (!there) s = 0u;
  uint i = surface_vertex(s), body = surface_body(s);
  vec3 low = positions[i].high, high = low;
#endif
  Pair own = Pair(positions[i].high, positions[i].low);
  uint held = there ? pair_lists[HELD + s] : NONE;
  float radius = held != NONE ? reach_of(uintBitsToFloat(pair_lists[DEPTHS + s])) : margin;
  for (uint k = 0u; k < CANDIDATES; ++k) found[k] = NONE, distances[k] = radius;
#if LANES > 1
  if (lane == 0u) waiting_count[part] = 0u;
#endif
  vec3 centre = 0.5 * (low + high), normal = vec3(0.0);
  float reach = 0.5 * distance(low, high) + 1.01 * radius;
  low -= radius, high += radius;
  if (lane == 0u) lows[part] = there ? low : vec3(1e30), highs[part] = there ? high : vec3(-1e30);
  if (gl_LocalInvocationIndex == 0u) leaf_count = staged_count = 0u, own_body = body;
  for (uint w = gl_LocalInvocationIndex; w < BODY_WORDS; w += GROUP_SIZE) near_bodies[w] = 0u;
#if QUERY_EDGES == 0
  if (there) normal = part_of_normal(s, lane);
  for (uint c = 0u; c < 3u; ++c) lists[3u * gl_LocalInvocationIndex + c] = floatBitsToUint(normal[c]);
#endif
  barrier();
#if QUERY_EDGES == 0
  normal = vec3(0.0);
  for (uint k = part * LANES; k < (part + 1u) * LANES; ++k)
    normal += uintBitsToFloat(uvec3(lists[3u * k], lists[3u * k + 1u], lists[3u * k + 2u]));
#endif
  vec3 lowest = lows[0], highest = highs[0];
  for (uint k = 1u; k < PER_GROUP; ++k) lowest = min(lowest, lows[k]), highest = max(highest, highs[k]);
  for (uint other = gl_LocalInvocationIndex; other < BODY_COUNT; other += GROUP_SIZE)
    if ((CONTACT_SELF != 0 || other != own_body) && in_body(other, lowest, highest)) atomicOr(near_bodies[other / 32u], 1u << (other % 32u));
  barrier();
  for (uint other = 0u; other < BODY_COUNT; ++other) {
    if ((near_bodies[other / 32u] >> (other % 32u) & 1u) == 0u) continue;
    for (uint l = first_leaf(other) + gl_LocalInvocationIndex; l < first_leaf(other + 1u); l += GROUP_SIZE) {
      if (!in_leaf(l, lowest, highest)) continue;
      uint slot = atomicAdd(leaf_count, 1u);
      if (slot < MOST_LEAVES) scratch[slot] = l;
    }
  }
  barrier();
  for (uint n = 0u; n < min(leaf_count, MOST_LEAVES); ++n)
    for (uint t = first_target(scratch[n]) + gl_LocalInvocationIndex; t < end_of_targets(scratch[n]); t += GROUP_SIZE) {
      vec4 sphere = pair_spheres[t];
      if (any(lessThan(sphere.xyz + 1.01 * sphere.w, lowest)) || any(greaterThan(sphere.xyz - 1.01 * sphere.w, highest))) continue;
      uint slot = atomicAdd(staged_count, 1u);
      if (slot < STAGED) lists[slot] = t;
    }
  barrier();
  bool listed = leaf_count <= MOST_LEAVES, staged = listed && staged_count <= STAGED;
  uint turns = !there ? 0u : staged ? 1u : listed ? leaf_count : LEAVES;
  for (uint n = 0u; n < turns; ++n) {
    uint leaf = staged ? 0u : listed ? scratch[n] : n;
    if (!staged && !in_leaf(leaf, low, high)) continue;
    uint end = staged ? staged_count : end_of_targets(leaf);
    for (uint j = lane + (staged ? 0u : first_target(leaf)); j < end; j += LANES) {
      uint t = staged ? lists[j] : j;
      vec4 sphere = pair_spheres[t];
      if (distance(sphere.xyz, centre) > reach + 1.01 * sphere.w) continue;
#if QUERY_EDGES
      if (t <= TRIANGLES + e) continue;  // of two edges, the first looks for the second
#endif
      bool same_body = target_body(t) == body;
#if CONTACT_SELF
      if (same_body && is_neighbour(s, t)) continue;
#else
      if (same_body) continue;
#endif
#if LANES > 1
      uint slot = staged ? atomicAdd(waiting_count[part], 1u) : WAITING;  // if not, scratch still has the leaves
      if (slot < WAITING) {
        scratch[part * WAITING + slot] = t;
        continue;
      }
#endif
      look_at(s, t, same_body, own, held, normal);
    }
  }
#if LANES > 1
  barrier();
  for (uint slot = lane; slot < min(waiting_count[part], WAITING); slot += LANES) {
    uint t = scratch[part * WAITING + slot];
    look_at(s, t, target_body(t) == body, own, held, normal);
  }
  merge(lane);
#endif
  if (lane != 0u) return;
  if (there) pair_lists[HELD + s] = NONE;
  if (found[0] == NONE) return;
  bool opposed = false;
  for (uint k = 0u; k < CANDIDATES; ++k) opposed = opposed || (found[k] & BESIDE) == 0u;
  if (!opposed) return;
  uint record = atomicAdd(pair_lists[RECORDS], 1u), k = RECORDS_AT + RECORD * record;
  need_groups(GROUPS, record / GROUP_SIZE + 1u);
  need_groups(LANE_GROUPS, record / (GROUP_SIZE / CANDIDATES) + 1u);
  pair_lists[k] = s;
  pair_lists[k + 2u] = 0u;
  for (uint c = 0u; c < CANDIDATES; ++c) pair_lists[k + CANDIDATE + c] = found[c];
}
