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
  vec3 sum = vec3(0.0), a = positions[surface_vertex(s)].high;
  for (uint k = pair_mesh[AROUND_AT + s] + 2u * lane; k < pair_mesh[AROUND_AT + s + 1u]; k += 2u * LANES) {
    vec3 n = cross(positions[pair_mesh[k]].high - a, positions[pair_mesh[k + 1u]].high - a);
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
shared uint lists[STAGED], staged_count;  // targets near the work-group's items; what each invocation found
#if QUERY_EDGES == 0
shared vec3 normals[GROUP_SIZE];
#endif
#define SCRATCH 768u                  // at least STAGED
#define MOST_PIECES (SCRATCH / 2u)
shared uint scratch[SCRATCH], piece_count;  // first and end of near leaves' targets, in pieces of GROUP_SIZE; what waits to be looked at, of each item; how
                                            // far what is in lists is (floats' bits)
#define AT_ONCE 4u                          // what is read does not wait for each other
#if LANES > 1
#define WAITING (SCRATCH / PER_GROUP)  // more are looked at as they are found, by lanes that wait for each other
shared uint waiting_count[PER_GROUP];
// Leaves the nearest of all lists in that of the first lane.
void merge(uint lane) {
  for (uint half_size = LANES / 2u; half_size > 0u; half_size /= 2u) {
    barrier();
    uint own = gl_LocalInvocationIndex * CANDIDATES, other = own + half_size * CANDIDATES;
    for (uint k = 0u; k < CANDIDATES; ++k) lists[own + k] = found[k], scratch[own + k] = floatBitsToUint(distances[k]);
    barrier();
    if (lane < half_size)
      for (uint k = 0u; k < CANDIDATES && lists[other + k] != NONE && uintBitsToFloat(scratch[other + k]) <= distances[CANDIDATES - 1u]; ++k)
        consider(lists[other + k], uintBitsToFloat(scratch[other + k]));
  }
}
#endif
shared vec3 lows[PER_GROUP], highs[PER_GROUP];  // of what each item looks at
shared uint found_count, first_record;
#if QUERY_EDGES
uint first_target(uint leaf) { return TRIANGLES + of_leaf(leaf, 5u); }
uint end_of_targets(uint leaf) { return TRIANGLES + of_leaf(leaf, 6u); }
#define LEAVES_OF_GROUPS LEAF_OF_EDGE_GROUP
#else
uint first_target(uint leaf) { return of_leaf(leaf, 1u); }
uint end_of_targets(uint leaf) { return of_leaf(leaf, 2u); }
#define LEAVES_OF_GROUPS LEAF_OF_GROUP
#endif
void main() {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  uint number = group_index() * PER_GROUP + part, own_leaf = pair_lists[LEAVES_OF_GROUPS + group_index()], body = of_leaf(own_leaf, 0u);
#if QUERY_EDGES
  uint s = number < pair_lists[NEAR_EDGES] ? pair_lists[NEAR_EDGES_AT + number] : NONE;
  bool there = s != NONE;
  if (!there) s = SURFACE_VERTICES;
  uint e = s - SURFACE_VERTICES, i = edge_vertex(e, 0u);
  vec3 end = positions[edge_vertex(e, 1u)].high, low = min(positions[i].high, end), high = max(positions[i].high, end);
#else
  uint s = number < pair_lists[NEAR_VERTICES] ? pair_lists[NEAR_AT + number] : NONE;
  bool there = s != NONE;
  if (!there) s = 0u;
  uint i = surface_vertex(s);
  vec3 low = positions[i].high, high = low;
#endif
  Pair own = Pair(positions[i].high, positions[i].low);
  uint held = there ? pair_lists[HELD + s] : NONE;
  float radius = held != NONE ? reach_of(uintBitsToFloat(pair_lists[DEPTHS + s])) : margin;
  for (uint k = 0u; k < CANDIDATES; ++k) found[k] = NONE, distances[k] = radius;
#if LANES > 1
  if (lane == 0u) waiting_count[part] = 0u;
#endif
  vec3 centre = 0.5 * (low + high);
  float reach = 0.5 * distance(low, high) + 1.01 * radius;
  low -= radius, high += radius;
  if (lane == 0u) lows[part] = there ? low : vec3(1e30), highs[part] = there ? high : vec3(-1e30);
  if (gl_LocalInvocationIndex == 0u) piece_count = staged_count = found_count = 0u;
  barrier();
  vec3 lowest = lows[0], highest = highs[0];
  for (uint k = 1u; k < PER_GROUP; ++k) lowest = min(lowest, lows[k]), highest = max(highest, highs[k]);
  uint near = NEAR_LEAVES_AT + (NEAR_LEAVES + 1u) * own_leaf, near_count = pair_lists[near];
  bool all_leaves = near_count > NEAR_LEAVES;
  for (uint n = gl_LocalInvocationIndex; n < (all_leaves ? LEAVES : near_count); n += GROUP_SIZE) {
    uint l = all_leaves ? n : pair_lists[near + 1u + n], end = end_of_targets(l);
    if (!in_leaf(l, lowest, highest) || (CONTACT_SELF == 0 && all_leaves && of_leaf(l, 0u) == body)) continue;
    for (uint first = first_target(l); first < end; first += GROUP_SIZE) {
      uint slot = atomicAdd(piece_count, 1u);
      if (slot < MOST_PIECES) scratch[2u * slot] = first, scratch[2u * slot + 1u] = min(first + GROUP_SIZE, end);
    }
  }
  barrier();
  uint pieces = min(piece_count, MOST_PIECES);
  for (uint n = 0u; n < pieces; n += AT_ONCE) {
    uint targets[AT_ONCE];
    vec4 spheres[AT_ONCE];
    for (uint j = 0u; j < AT_ONCE; ++j) {
      uint piece = min(n + j, pieces - 1u), t = scratch[2u * piece] + gl_LocalInvocationIndex;
      targets[j] = n + j < pieces && t < scratch[2u * piece + 1u] ? t : NONE;
      spheres[j] = pair_spheres[min(t, TRIANGLES + EDGES - 1u)];
    }
    for (uint j = 0u; j < AT_ONCE; ++j) {
      vec3 centre = spheres[j].xyz;
      float radius = 1.01 * spheres[j].w;
      if (targets[j] == NONE || any(lessThan(centre + radius, lowest)) || any(greaterThan(centre - radius, highest))) continue;
      uint slot = atomicAdd(staged_count, 1u);
      if (slot < STAGED) lists[slot] = targets[j];
    }
  }
  barrier();
  bool listed = piece_count <= MOST_PIECES, staged = listed && staged_count <= STAGED;
  if (staged && staged_count == 0u) {
    if (lane == 0u && there) pair_lists[HELD + s] = NONE;
    return;
  }
  vec3 normal = vec3(0.0);
#if QUERY_EDGES == 0
  normals[gl_LocalInvocationIndex] = there ? part_of_normal(s, lane) : vec3(0.0);
  barrier();
  for (uint k = part * LANES; k < (part + 1u) * LANES; ++k) normal += normals[k];
#endif
  uint turns = !there ? 0u : staged ? 1u : listed ? pieces : LEAVES;
  for (uint n = 0u; n < turns; ++n) {
    if (!listed && (!in_leaf(n, low, high) || (CONTACT_SELF == 0 && of_leaf(n, 0u) == body))) continue;
    uint first = staged ? 0u : listed ? scratch[2u * n] : first_target(n), end = staged ? staged_count : listed ? scratch[2u * n + 1u] : end_of_targets(n);
    for (uint k = first + lane; k < end; k += AT_ONCE * LANES) {
      uint targets[AT_ONCE];
      vec4 spheres[AT_ONCE];
      for (uint j = 0u; j < AT_ONCE; ++j) {
        uint at = min(k + j * LANES, end - 1u);
        targets[j] = staged ? lists[at] : at;
        spheres[j] = pair_spheres[targets[j]];
      }
      for (uint j = 0u; j < AT_ONCE; ++j) {
        uint t = targets[j];
        vec4 sphere = spheres[j];
        if (k + j * LANES >= end || distance(sphere.xyz, centre) > reach + 1.01 * sphere.w) continue;
#if QUERY_EDGES
        if (t <= TRIANGLES + e) continue;  // of two edges, the first looks for the second
#endif
        bool same_body = CONTACT_SELF != 0 && target_body(t) == body;
#if CONTACT_SELF
        if (same_body && is_neighbour(s, t)) continue;
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
  }
#if LANES > 1
  barrier();
  for (uint slot = lane; slot < min(waiting_count[part], WAITING); slot += LANES) {
    uint t = scratch[part * WAITING + slot];
    look_at(s, t, CONTACT_SELF != 0 && target_body(t) == body, own, held, normal);
  }
  merge(lane);
#endif
  bool opposed = false;
  for (uint k = 0u; k < CANDIDATES; ++k) opposed = opposed || (found[k] & BESIDE) == 0u;
  bool keeps = lane == 0u && there && opposed;
  uint record = keeps ? atomicAdd(found_count, 1u) : 0u;
  barrier();
  if (gl_LocalInvocationIndex == 0u && found_count > 0u) {
    first_record = atomicAdd(pair_lists[RECORDS], found_count);
    uint last = first_record + found_count - 1u;
    need_groups(GROUPS, last / GROUP_SIZE + 1u);
    need_groups(LANE_GROUPS, last / (GROUP_SIZE / CANDIDATES) + 1u);
  }
  barrier();
  if (lane == 0u && there) pair_lists[HELD + s] = NONE;
  if (!keeps) return;
  uint k = RECORDS_AT + RECORD * (first_record + record);
  pair_lists[k] = s;
  pair_lists[k + 2u] = 0u;
  for (uint c = 0u; c < CANDIDATES; ++c) pair_lists[k + CANDIDATE + c] = found[c];
}
