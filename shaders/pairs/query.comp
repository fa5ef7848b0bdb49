// The candidates of each vertex of a surface: the nearest triangles within the margin, of equally near ones those of the least number, so that
// the order in which they are found plays no part. A vertex that is deep in a body looks as far as its surface. LANES invocations per vertex: each
// looks into some of the cells; then each looks at some of the triangles found there, and their lists are merged.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
#include "pairs/formulas.glsl"
#if CONTACT_SELF
layout(std430, binding = BIND_PAIR_REST) restrict readonly buffer PairRest { vec4 pair_rest[]; };  // places by vertex
// Of its own body a vertex meets what is not its neighbour at rest either.
bool is_neighbour(uint i, uint t) {
  vec3 x = pair_rest[i].xyz;
  for (uint c = 0u; c < 3u; ++c)
    if (distance(x, pair_rest[triangle_vertex(t, c)].xyz) < 2.0 * CELL) return true;
  return false;
}
#endif
void corners_of(uint t, Pair own, out vec3 corners[3]) {
  for (uint c = 0u; c < 3u; ++c) {
    Position p = positions[triangle_vertex(t, c)];
    corners[c] = relative(Pair(p.high, p.low), own);
  }
}
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
// Triangle t, and a vertex at `own`, of the same body or not, whose normal is `normal`; a sheet has two sides.
void look_at(uint t, bool same_body, Pair own, bool sheet, vec3 normal) {
  vec3 corners[3];
  corners_of(t, own, corners);
  vec3 beyond = max(max(min(corners[0], min(corners[1], corners[2])), -max(corners[0], max(corners[1], corners[2]))), vec3(0.0));
  if (dot(beyond, beyond) > 1.01 * distances[CANDIDATES - 1u] * distances[CANDIDATES - 1u]) return;
  Meeting m = meet(corners[0], corners[1], corners[2]);
#if CONTACT_SELF
  if (same_body && abs(m.gap) > SELF_MARGIN) return;  // a thin part's other side is no contact
#endif
  if (m.rank <= distances[CANDIDATES - 1u]) consider(sheet || opposes(m, normal) ? t : t | BESIDE, m.rank);
}
#if LANES > 1
#define WAITING 96u  // triangles per vertex; more are looked at at once, by lanes that wait for each other
shared uint waiting[GROUP_SIZE / LANES][WAITING], waiting_count[GROUP_SIZE / LANES];
shared uint lists[GROUP_SIZE][CANDIDATES];
shared float list_distances[GROUP_SIZE][CANDIDATES];
shared uint near_some[GROUP_SIZE / LANES];
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
// Whether another body is near, or this one is asked for as well; each lane asks about some of them.
bool near_some_other(uint lane, uint part, uint body, vec3 low, vec3 high) {
#if CONTACT_SELF || LANES == 1
  return near_another(body, low, high);
#else
  if (lane == 0u) near_some[part] = 0u;
  barrier();
  for (uint other = lane; other < BODY_COUNT; other += LANES)
    if (other != body && in_box(other, low, high)) near_some[part] = 1u;
  barrier();
  return near_some[part] != 0u;
#endif
}
void main() {
  uint lane = gl_LocalInvocationIndex % LANES, part = gl_LocalInvocationIndex / LANES;
  uint s = group_index() * (GROUP_SIZE / LANES) + part;
  bool there = s < SURFACE_VERTICES;
  uint i = surface_vertex(there ? s : 0u), body = surface_body(there ? s : 0u);
  Pair own = Pair(positions[i].high, positions[i].low);
  uint held = there ? pair_lists[HELD + s] : NONE;
  float radius = margin;
  if (held != NONE) {
    vec3 corners[3];
    corners_of(held, own, corners);
    radius = max(margin, 1.05 * abs(meet(corners[0], corners[1], corners[2]).gap) + 0.5 * margin);
  }
  for (uint k = 0u; k < CANDIDATES; ++k) found[k] = NONE, distances[k] = radius;
#if LANES > 1
  if (lane == 0u) waiting_count[part] = 0u;
  barrier();
#endif
  bool near = near_some_other(lane, part, body, own.high - radius, own.high + radius);
  bool sheet = surface_thickness(there ? s : 0u) > 0.0;
  vec3 normal = vec3(0.0);
  if (there && near) {
    normal = vec3(ivec3(pair_grid[CELLS + 3u * i], pair_grid[CELLS + 3u * i + 1u], pair_grid[CELLS + 3u * i + 2u]));
    ivec3 first = cell_of(own.high - radius), across = cell_of(own.high + radius) - first + 1;
    for (int c = int(lane); c < across.x * across.y * across.z; c += int(LANES)) {
      ivec3 cell = first + ivec3(c % across.x, c / across.x % across.y, c / (across.x * across.y));
      // A triangle that is in several of these cells is looked at in one of them: along each axis in its first or in the vertex's.
      uint known = (cell.x == first.x ? FIRST_ALONG_X : 0u) | (cell.y == first.y ? FIRST_ALONG_X << 1 : 0u) | (cell.z == first.z ? FIRST_ALONG_X << 2 : 0u);
      for (uint entry = pair_grid[hash_of(cell)]; entry != 0u;) {
        uint k = ENTRIES_AT + 3u * (entry - 1u), t = pair_grid[k], of_body = pair_grid[k + 1u];
        entry = pair_grid[k + 2u];
        if ((known | of_body | BODY_OF_ENTRY) != 0xffffffffu) continue;
        of_body &= BODY_OF_ENTRY;
#if CONTACT_SELF
        if (of_body == body && is_neighbour(i, t)) continue;
#else
        if (of_body == body) continue;
#endif
#if LANES > 1
        uint slot = atomicAdd(waiting_count[part], 1u);
        if (slot < WAITING) {
          waiting[part][slot] = t;
          continue;
        }
#endif
        look_at(t, of_body == body, own, sheet, normal);
      }
    }
  }
#if LANES > 1
  barrier();
  for (uint slot = lane; slot < min(waiting_count[part], WAITING); slot += LANES)
    look_at(waiting[part][slot], triangle_body(waiting[part][slot]) == body, own, sheet, normal);
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
  for (uint c = 0u; c < CANDIDATES; ++c) pair_lists[k + 2u + c] = found[c];
}
