// Broad phase: the candidates of each vertex of a surface or, with QUERY_EDGES, of each sharp edge, which are the
// nearest targets within the margin; of equally near ones those of the least number, so that the order of finding them
// does not matter. An item deep in a body searches as far as the body's surface.
#include "contact/bodies/pairs.glsl"
layout(std430) restrict readonly buffer Positions { Position positions[]; };
#include "contact/bodies/formulas.glsl"
#include "contact/bodies/meeting.glsl"
#if CONTACT_SELF
layout(std430) restrict readonly buffer PairRest { vec4 pair_rest[]; };  // positions by vertex
// Whether an item and a target of one body are too near each other at rest for contact; in a sheet if they share a
// vertex.
bool is_neighbour(uint s, uint t) {
  uvec4 vertices = contact_vertices(s, t);
  float apart = thickness_of(item_body(s)) > 0.0 ? 0.0 : 2.4 * EDGE;
  uint own = item_is_edge(s) ? 2u : 1u;
  for (uint a = 0u; a < own; ++a)
    for (uint b = own; b < 4u; ++b)
      if (distance(pair_rest[vertices[a]].xyz, pair_rest[vertices[b]].xyz) <= apart) return true;
  return false;
}
#endif
uint found[CANDIDATES];
float distances[CANDIDATES];
void insert_candidate(uint t, float d) {
  for (uint k = 0u; k < CANDIDATES; ++k) {
    bool before = d < distances[k] || (d == distances[k] && t < found[k]);
    uint t_out = before ? found[k] : t;
    float d_out = before ? distances[k] : d;
    if (before) found[k] = t, distances[k] = d;
    t = t_out, d = d_out;
  }
}
// Inserts target t, of the same body as item s or not, among the candidates of s if it is near enough. `own`: the
// position of the item's first vertex; `held`: the target that it was in; `normal`: that of an item that is a vertex.
#if QUERY_EDGES
void try_target(uint s, uint t, bool same_body, DoubleSingle own, uint held, vec3 normal) {
  uvec4 vertices = contact_vertices(s, t), beside = vertices_beside(s, t);
  vec3 p = from_own(vertices.y, own), q = from_own(vertices.z, own), r = from_own(vertices.w, own);
  vec3 left = from_own(beside.x, own), right = from_own(beside.y, own), other_left = from_own(beside.z, own),
       other_right = from_own(beside.w, own);
  float far = edge_edge_contact(p, left, right, q, r, other_left, other_right).rank;
  if (same_body && far > SELF_MARGIN) return;
  if (far <= distances[CANDIDATES - 1u] && edges_oppose(p, left, right, q, r, other_left, other_right))
    insert_candidate(t, far);
}
#define FIRST_ITEM SURFACE_VERTICES
uvec2 item_ends(uint s) { return edge_vertices[s - SURFACE_VERTICES].xy; }
uint first_target(uint leaf) { return TRIANGLES + leaves[leaf].edges[0]; }
uint end_of_targets(uint leaf) { return TRIANGLES + leaves[leaf].edges[1]; }
#define NEAR_COUNT counts.near_edges
#define NEAR_ITEMS near_edges
#define LEAVES_OF_GROUPS leaf_of_edge_group
#else
void try_target(uint s, uint t, bool same_body, DoubleSingle own, uint held, vec3 normal) {
  uvec4 corners = triangles[t];
  vec3 a = from_own(corners.x, own), b = from_own(corners.y, own), c = from_own(corners.z, own);
  vec3 beyond = max(max(min(a, min(b, c)), -max(a, max(b, c))), vec3(0.0));
  // A crossed triangle of a sheet goes before all others, however far it is.
  bool has_sides = SHEETS != 0 && thickness_of(corners.w) > 0.0;
  if (!has_sides && dot(beyond, beyond) > 1.01 * distances[CANDIDATES - 1u] * distances[CANDIDATES - 1u]) return;
  Contact m = vertex_triangle_contact(a, b, c);
  bool opposed = opposes(m, normal);
#if SHEETS
  if (has_sides) {  // the vertex belongs on the side where it is or, if it was in a triangle nearby, where it was then
    bool under = dot(m.face, a) > 0.0, was_near = false;
    for (uint j = 0u; j < 3u && held != NONE; ++j)
      for (uint l = 0u; l < 3u; ++l) was_near = was_near || triangles[held & TARGET][j] == corners[l];
    if (was_near) under = (held & UNDER) != 0u;
    if (under) t |= UNDER;
    m = vertex_sheet_contact(m, a, b, c, under);
    opposed = true;
  } else if (thickness_of(surface_body(s)) > 0.0) {
    opposed = true;
  }
#endif
  if (same_body && abs(m.gap) > SELF_MARGIN) return;  // no contact with a thin part's other side
  if (m.rank <= distances[CANDIDATES - 1u]) insert_candidate(opposed ? t : t | BESIDE, m.rank);
}
// The sum of the normals of triangles around a vertex, of which each of LANES invocations adds up a part.
vec3 sum_normals(uint s, uint lane) {
  vec3 sum = vec3(0.0), a = positions[surface_vertex(s)].high;
  for (uint k = first_around[s] + lane; k < first_around[s + 1u]; k += LANES) {
    vec3 n = cross(positions[around[k].x].high - a, positions[around[k].y].high - a);
    float area = length(n);
    if (area > 0.0) sum += n / area;
  }
  return sum;
}
shared vec3 normals[GROUP_SIZE];
#define FIRST_ITEM 0u
uvec2 item_ends(uint s) { return uvec2(surface_vertex(s)); }
uint first_target(uint leaf) { return leaves[leaf].triangles[0]; }
uint end_of_targets(uint leaf) { return leaves[leaf].triangles[1]; }
#define NEAR_COUNT counts.near_vertices
#define NEAR_ITEMS near_vertices
#define LEAVES_OF_GROUPS leaf_of_group
#endif
// Shared memory limits how many work-groups run at once, so these arrays serve several purposes in turn.
#define WAITING 96u  // an item with more targets tests them as it finds them
#define MOST_PIECES (GROUP_SIZE * CANDIDATES / 2u)
// Targets that each item is to test; then the candidates of each invocation.
shared uint lists[max(PER_GROUP * WAITING, GROUP_SIZE * CANDIDATES)];
// First and end of near leaves' targets, in pieces of GROUP_SIZE; then the distances of candidates, as floats' bits.
shared uint scratch[2u * MOST_PIECES];
shared uint piece_count, waiting_count[PER_GROUP], items[PER_GROUP], found_count, crowded_count, first_record;
shared vec4 balls[PER_GROUP];  // that hold each item's search region: centre, radius (below 0 without an item)
// Without contact of bodies with themselves, leaves of the same body are left out elsewhere.
bool is_own(uint t, uint body) { return CONTACT_SELF != 0 && target_body(t) == body; }
// Whether item s, of that body, and target t can be in contact at all.
bool can_touch(uint s, uint t, uint body) {
#if QUERY_EDGES
  if (t <= TRIANGLES + s - SURFACE_VERTICES) return false;  // the first of two edges finds the second
#endif
#if CONTACT_SELF
  return !is_own(t, body) || !is_neighbour(s, t);
#else
  return true;
#endif
}
bool is_near(vec4 ball, vec4 sphere) { return distance(sphere.xyz, ball.xyz) <= ball.w + 1.01 * sphere.w; }
// Lists target t, which lies in the sphere, for each item near it.
void list_target(uint t, vec4 sphere, vec3 lowest, vec3 highest, uint body) {
  if (any(lessThan(sphere.xyz + 1.01 * sphere.w, lowest)) || any(greaterThan(sphere.xyz - 1.01 * sphere.w, highest)))
    return;
  for (uint p = 0u; p < PER_GROUP; ++p)
    if (is_near(balls[p], sphere) && can_touch(items[p], t, body)) {
      uint slot = atomicAdd(waiting_count[p], 1u);
      if (slot < WAITING) lists[p * WAITING + slot] = t;
    }
}
// Merges the candidates of an item's invocations into those of the first lane.
void merge(uint lane) {
  for (uint half_size = LANES / 2u; half_size > 0u; half_size /= 2u) {
    barrier();
    uint own = gl_LocalInvocationIndex * CANDIDATES, other = own + half_size * CANDIDATES;
    for (uint k = 0u; k < CANDIDATES; ++k) lists[own + k] = found[k], scratch[own + k] = floatBitsToUint(distances[k]);
    barrier();
    if (lane < half_size)
      for (uint k = 0u; k < CANDIDATES && lists[other + k] != NONE &&
                        uintBitsToFloat(scratch[other + k]) <= distances[CANDIDATES - 1u];
           ++k)
        insert_candidate(lists[other + k], uintBitsToFloat(scratch[other + k]));
  }
}
// Lists the targets of near leaves in pieces.
void list_pieces(uint own_leaf, uint body, vec3 lowest, vec3 highest) {
  uint near_count = near_leaves[own_leaf].count;
  bool all_leaves = near_count > NEAR_LEAVES;
  for (uint n = gl_LocalInvocationIndex; n < (all_leaves ? LEAVES : near_count); n += GROUP_SIZE) {
    uint l = all_leaves ? n : near_leaves[own_leaf].leaves[n], end = end_of_targets(l);
    if (!is_in_leaf(l, lowest, highest) || (CONTACT_SELF == 0 && all_leaves && leaves[l].body == body)) continue;
    for (uint first = first_target(l); first < end; first += GROUP_SIZE) {
      uint slot = atomicAdd(piece_count, 1u);
      if (slot < MOST_PIECES) scratch[2u * slot] = first, scratch[2u * slot + 1u] = min(first + GROUP_SIZE, end);
    }
  }
}
// Lists for each item the targets near it. Each invocation tests one target of a piece by its sphere.
void list_targets(uint pieces, uint body, vec3 lowest, vec3 highest) {
  const uint at_once = 4u;  // reads in flight, instead of one after the other
  for (uint n = 0u; n < pieces; n += at_once) {
    uint targets[at_once];
    vec4 spheres[at_once];
    for (uint j = 0u; j < at_once; ++j) {
      uint piece = min(n + j, pieces - 1u), t = scratch[2u * piece] + gl_LocalInvocationIndex;
      targets[j] = n + j < pieces && t < scratch[2u * piece + 1u] ? t : NONE;
      spheres[j] = pair_spheres[min(t, TRIANGLES + EDGES - 1u)];
    }
    for (uint j = 0u; j < at_once; ++j)
      if (targets[j] != NONE) list_target(targets[j], spheres[j], lowest, highest, body);
  }
}
// Tries every LANESth of the targets listed for item s or, where they were too many, of all pieces or leaves.
void try_targets(uint s, bool there, bool listed, uint pieces, uint body, DoubleSingle own, uint held, vec3 normal) {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  if (listed && waiting_count[part] <= WAITING) {
    for (uint slot = lane; slot < waiting_count[part]; slot += LANES) {
      uint t = lists[part * WAITING + slot];
      try_target(s, t, is_own(t, body), own, held, normal);
    }
  } else {
    for (uint n = 0u; n < (!there ? 0u : listed ? pieces : LEAVES); ++n) {
      if (!listed && CONTACT_SELF == 0 && leaves[n].body == body) continue;
      uint end = listed ? scratch[2u * n + 1u] : end_of_targets(n);
      for (uint t = (listed ? scratch[2u * n] : first_target(n)) + lane; t < end; t += LANES)
        if (is_near(balls[part], pair_spheres[t]) && can_touch(s, t, body))
          try_target(s, t, is_own(t, body), own, held, normal);
    }
  }
}
// Writes a record of item s if any candidate can push it; records of a work-group lie one after the other.
void write_record(uint s, bool there) {
  uint lane = gl_LocalInvocationIndex % LANES;
  bool opposed = false, beside = false;
  for (uint k = 0u; k < CANDIDATES; ++k) {
    opposed = opposed || (found[k] & BESIDE) == 0u;
    beside = beside || (found[k] & BESIDE) != 0u;
  }
  if (lane == 0u && there && beside && found[CANDIDATES - 1u] != NONE) atomicAdd(crowded_count, 1u);
  bool keeps = lane == 0u && there && opposed;
  uint record = keeps ? atomicAdd(found_count, 1u) : 0u;
  barrier();
  if (gl_LocalInvocationIndex == 0u && crowded_count > 0u) atomicAdd(totals.crowded, crowded_count);
  if (gl_LocalInvocationIndex == 0u && found_count > 0u) {
    first_record = atomicAdd(counts.records, found_count);
    uint last = first_record + found_count - 1u;
    need_groups(RECORD_GROUPS, last / GROUP_SIZE + 1u);
    need_groups(LANE_GROUPS, last / (GROUP_SIZE / CANDIDATES) + 1u);
  }
  barrier();
  if (lane == 0u && there) held_by[s] = NONE;
  if (!keeps) return;
  record += first_record;
  records[record].item = s;
  records[record].next = 0u;
  for (uint c = 0u; c < CANDIDATES; ++c) records[record].candidates[c] = found[c];
}
void main() {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  if (group_index() * PER_GROUP >= NEAR_COUNT) return;  // rows of work-groups are whole
  uint number = group_index() * PER_GROUP + part, own_leaf = LEAVES_OF_GROUPS[group_index()],
       body = leaves[own_leaf].body;
  uint s = number < NEAR_COUNT ? NEAR_ITEMS[number] : NONE;
  bool there = s != NONE;
  if (!there) s = FIRST_ITEM;
  uvec2 ends = item_ends(s);
  DoubleSingle own = DoubleSingle(positions[ends.x].high, positions[ends.x].low);
  vec3 end = positions[ends.y].high;
  uint held = there ? held_by[s] : NONE;
  float radius = held != NONE ? reach_of(depths[s]) : margin;
  for (uint k = 0u; k < CANDIDATES; ++k) found[k] = NONE, distances[k] = radius;
  vec4 ball =
      there ? vec4(0.5 * (own.high + end), 0.5 * distance(own.high, end) + 1.01 * radius) : vec4(vec3(0.0), -1e30);
  if (lane == 0u) waiting_count[part] = 0u, items[part] = s, balls[part] = ball;
  if (gl_LocalInvocationIndex == 0u) piece_count = found_count = crowded_count = 0u;
  barrier();
  vec3 lowest = vec3(1e30), highest = vec3(-1e30);
  for (uint p = 0u; p < PER_GROUP; ++p)
    if (balls[p].w > 0.0)
      lowest = min(lowest, balls[p].xyz - balls[p].w), highest = max(highest, balls[p].xyz + balls[p].w);
  list_pieces(own_leaf, body, lowest, highest);
  barrier();
  uint pieces = min(piece_count, MOST_PIECES);
  list_targets(pieces, body, lowest, highest);
  barrier();
  bool listed = piece_count <= MOST_PIECES, any_waits = !listed;
  for (uint p = 0u; p < PER_GROUP; ++p) any_waits = any_waits || waiting_count[p] > 0u;
  if (!any_waits) {
    if (lane == 0u && there) held_by[s] = NONE;
    return;
  }
  vec3 normal = vec3(0.0);
#if QUERY_EDGES == 0
  normals[gl_LocalInvocationIndex] = there ? sum_normals(s, lane) : vec3(0.0);
  barrier();
  for (uint k = part * LANES; k < (part + 1u) * LANES; ++k) normal += normals[k];
#endif
  try_targets(s, there, listed, pieces, body, own, held, normal);
  merge(lane);
  write_record(s, there);
}
