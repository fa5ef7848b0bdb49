// The candidates of each vertex of a surface or, with QUERY_EDGES, of each sharp edge: the nearest targets within the margin, of equally near ones
// those of the least number, so that the order in which they are found plays no part. One that is deep in a body looks as far as its surface. LANES
// invocations per item: each looks into some of the cells; then each looks at some of the targets found there, and their lists are merged.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
#include "pairs/formulas.glsl"
#include "pairs/meeting.glsl"
layout(std430, binding = BIND_PAIR_SPHERES) restrict readonly buffer PairSpheres { vec4 pair_spheres[]; };  // around each target: centre, radius
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
uint found[CANDIDATES];
float distances[CANDIDATES];
void consider(uint t, float d) {
  uint at = CANDIDATES;
  for (uint k = CANDIDATES; k-- > 0u;) {
    if (found[k] == t) return;
    if (d < distances[k] || (d == distances[k] && t < found[k])) at = k;
  }
  for (uint k = 0u; k < CANDIDATES; ++k) {
    if (k < at) continue;
    uint t_out = found[k];
    float d_out = distances[k];
    found[k] = t, distances[k] = d;
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
  if (far <= distances[CANDIDATES - 1u] && edges_oppose(p, left, right, q, r, other_left, other_right)) consider(t, far);
}
#else
void look_at(uint s, uint t, bool same_body, Pair own, uint held, vec3 normal) {
  vec3 a = from_own(triangle_vertex(t, 0u), own), b = from_own(triangle_vertex(t, 1u), own), c = from_own(triangle_vertex(t, 2u), own);
  vec3 beyond = max(max(min(a, min(b, c)), -max(a, max(b, c))), vec3(0.0));
  if (dot(beyond, beyond) > 1.01 * distances[CANDIDATES - 1u] * distances[CANDIDATES - 1u]) return;
  Meeting m = meet(a, b, c);
  bool opposed = opposes(m, normal);
#if SHEETS
  if (thickness_of(triangle_body(t)) > 0.0) {  // it has two sides: that where the vertex is, or was before it went through
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
#if LANES > 1
#define WAITING 96u  // triangles per vertex; more are looked at at once, by lanes that wait for each other
shared uint waiting[GROUP_SIZE / LANES][WAITING], waiting_count[GROUP_SIZE / LANES];
shared uint lists[GROUP_SIZE][CANDIDATES];
shared float list_distances[GROUP_SIZE][CANDIDATES];
// Leaves the nearest of all lists in that of the first lane.
void merge(uint lane) {
  for (uint half_size = LANES / 2u; half_size > 0u; half_size /= 2u) {
    for (uint k = 0u; k < CANDIDATES; ++k) lists[gl_LocalInvocationIndex][k] = found[k], list_distances[gl_LocalInvocationIndex][k] = distances[k];
    barrier();
    if (lane < half_size) {
      uint from = gl_LocalInvocationIndex + half_size;
      for (uint k = 0u; k < CANDIDATES; ++k)
        if (lists[from][k] != NONE && list_distances[from][k] <= distances[CANDIDATES - 1u]) consider(lists[from][k], list_distances[from][k]);
    }
    barrier();
  }
}
#endif
void main() {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  uint number = group_index() * (GROUP_SIZE / LANES) + part;
#if QUERY_EDGES
  bool there = number < pair_lists[NEAR_EDGES];
  uint s = there ? pair_lists[NEAR_AT + SURFACE_VERTICES + number] : SURFACE_VERTICES, e = s - SURFACE_VERTICES;
  uint i = edge_vertex(e, 0u), body = edge_body(e);
  vec3 end = positions[edge_vertex(e, 1u)].high, low = min(positions[i].high, end), high = max(positions[i].high, end);
#else
  bool there = number < pair_lists[NEAR_VERTICES];
  uint s = there ? pair_lists[NEAR_AT + number] : 0u, i = surface_vertex(s), body = surface_body(s);
  vec3 low = positions[i].high, high = low;
#endif
  Pair own = Pair(positions[i].high, positions[i].low);
  uint held = there ? pair_lists[HELD + s] : NONE;
  float radius = held != NONE ? reach_of(uintBitsToFloat(pair_lists[DEPTHS + s])) : margin;
  for (uint k = 0u; k < CANDIDATES; ++k) found[k] = NONE, distances[k] = radius;
#if LANES > 1
  if (lane == 0u) waiting_count[part] = 0u;
  barrier();
#endif
  vec3 normal = vec3(0.0);
  if (there) {
    if (QUERY_EDGES == 0) normal = vec3(ivec3(pair_grid[CELLS + 3u * i], pair_grid[CELLS + 3u * i + 1u], pair_grid[CELLS + 3u * i + 2u]));
    ivec3 first = cell_of(low - radius), across = cell_of(high + radius) - first + 1;
    for (int c = int(lane); c < across.x * across.y * across.z; c += int(LANES)) {
      ivec3 cell = first + ivec3(c % across.x, c / across.x % across.y, c / (across.x * across.y));
      // A triangle that is in several of these cells is looked at in one of them: along each axis in its first or in the vertex's.
      uint known = (cell.x == first.x ? FIRST_ALONG_X : 0u) | (cell.y == first.y ? FIRST_ALONG_X << 1 : 0u) | (cell.z == first.z ? FIRST_ALONG_X << 2 : 0u);
      for (uint entry = pair_grid[hash_of(cell + QUERY_EDGES * edge_cells)]; entry != 0u;) {
        uint k = ENTRIES_AT + 3u * (entry - 1u), t = pair_grid[k], of_body = pair_grid[k + 1u];
        entry = pair_grid[k + 2u];
        if ((known | of_body | BODY_OF_ENTRY) != 0xffffffffu) continue;
#if QUERY_EDGES
        if (t <= TRIANGLES + e) continue;  // of two edges, the first looks for the second
#elif EDGES
        if (t >= TRIANGLES) continue;
#endif
        of_body &= BODY_OF_ENTRY;
        if (CONTACT_SELF == 0 && of_body == body) continue;
        vec4 sphere = pair_spheres[t];
        if (distance(sphere.xyz, 0.5 * (low + high)) > 0.5 * distance(low, high) + 1.01 * (radius + sphere.w)) continue;
#if CONTACT_SELF
        if (of_body == body && is_neighbour(s, t)) continue;
#endif
#if LANES > 1
        uint slot = atomicAdd(waiting_count[part], 1u);
        if (slot < WAITING) {
          waiting[part][slot] = t;
          continue;
        }
#endif
        look_at(s, t, of_body == body, own, held, normal);
      }
    }
  }
#if LANES > 1
  barrier();
  for (uint slot = lane; slot < min(waiting_count[part], WAITING); slot += LANES)
    look_at(s, waiting[part][slot], target_body(waiting[part][slot]) == body, own, held, normal);
  merge(lane);
#endif
  if (lane != 0u) return;
  if (there) pair_lists[HELD + s] = NONE;
  if (found[0] == NONE) return;
  bool opposed = false;
  for (uint k = 0u; k < CANDIDATES; ++k) opposed = opposed || (found[k] & BESIDE) == 0u;
  if (!opposed) return;
  uint record = atomicAdd(pair_lists[RECORDS], 1u), k = RECORDS_AT + RECORD * record;
  atomicMax(pair_lists[GROUPS], record / GROUP_SIZE + 1u);
  atomicMax(pair_lists[LANE_GROUPS], record / (GROUP_SIZE / CANDIDATES) + 1u);
  pair_lists[k] = s;
  pair_lists[k + 2u] = 0u;
  for (uint c = 0u; c < CANDIDATES; ++c) pair_lists[k + CANDIDATE + c] = found[c];
}
