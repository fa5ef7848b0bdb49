// The candidates of each vertex of a surface: the nearest triangles within the margin, of equally near ones those of the least number, so that
// the order in which they are found plays no part. A vertex that is deep in a body looks as far as its surface. One invocation per vertex.
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
Meeting meeting_of(uint t, Pair own) {
  vec3 corners[3];
  for (uint c = 0u; c < 3u; ++c) {
    Position p = positions[triangle_vertex(t, c)];
    corners[c] = relative(Pair(p.high, p.low), own);
  }
  return meet(corners[0], corners[1], corners[2]);
}
void main() {
  uint s = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (s >= SURFACE_VERTICES) return;
  uint i = surface_vertex(s), body = surface_body(s);
  Pair own = Pair(positions[i].high, positions[i].low);
  uint held = pair_lists[HELD + s];
  float radius = held == NONE ? margin : max(margin, 1.05 * abs(meeting_of(held, own).gap) + 0.5 * margin);
  pair_lists[HELD + s] = NONE;
  if (!near_another(body, own.high - radius, own.high + radius)) return;
  vec3 normal = vec3(ivec3(pair_grid[CELLS + 3u * i], pair_grid[CELLS + 3u * i + 1u], pair_grid[CELLS + 3u * i + 2u]));
  bool solid = !(surface_thickness(s) > 0.0);  // a sheet has two sides
  uint found[CANDIDATES];
  float distances[CANDIDATES];
  for (uint k = 0u; k < CANDIDATES; ++k) found[k] = NONE, distances[k] = radius;
  ivec3 first = cell_of(own.high - radius), last = cell_of(own.high + radius);
  for (int z = first.z; z <= last.z; ++z)
    for (int y = first.y; y <= last.y; ++y)
      for (int x = first.x; x <= last.x; ++x)
        for (uint entry = pair_grid[hash_of(ivec3(x, y, z))]; entry != 0u;) {
          uint t = pair_grid[ENTRIES_AT + 2u * (entry - 1u)];
          entry = pair_grid[ENTRIES_AT + 2u * (entry - 1u) + 1u];
#if CONTACT_SELF
          if (triangle_body(t) == body && is_neighbour(i, t)) continue;
#else
          if (triangle_body(t) == body) continue;
#endif
          Meeting m = meeting_of(t, own);
          float d = m.rank;
#if CONTACT_SELF
          if (triangle_body(t) == body && abs(m.gap) > SELF_MARGIN) continue;  // a thin part's other side is no contact
#endif
          if (solid && !opposes(m, normal)) t |= BESIDE;
          uint at = CANDIDATES;
          for (uint k = CANDIDATES; k-- > 0u;) {
            if (found[k] == t) {
              at = CANDIDATES;
              break;
            }
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
  if (found[0] == NONE) return;
  bool opposed = false;
  for (uint k = 0u; k < CANDIDATES; ++k) opposed = opposed || (found[k] & BESIDE) == 0u;
  if (!opposed) return;
  uint record = atomicAdd(pair_lists[RECORDS], 1u), k = RECORDS_AT + RECORD * record;
  atomicMax(pair_lists[GROUPS], record / GROUP_SIZE + 1u);
  pair_lists[k] = s;
  for (uint c = 0u; c < CANDIDATES; ++c) pair_lists[k + 2u + c] = found[c];
}
