// Puts triangles and sharp edges of leaves that are near another body into the cells that they are in. One invocation per target of these.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_PAIR_SPHERES) restrict writeonly buffer PairSpheres { vec4 pair_spheres[]; };
const int most_cells = 4096, most_along = 256;  // of a triangle: those of a body that is torn out of shape would have no end
void main() {
  uint number = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (number >= pair_lists[NEAR_TARGETS]) return;
  uint t = pair_lists[TARGETS_AT + number];
  bool is_edge = EDGES > 0u && t >= TRIANGLES;
  uvec3 corners = is_edge ? uvec3(edge_vertex(t - TRIANGLES, 0u), edge_vertex(t - TRIANGLES, 1u), edge_vertex(t - TRIANGLES, 1u))
                          : uvec3(triangle_vertex(t, 0u), triangle_vertex(t, 1u), triangle_vertex(t, 2u));
  vec3 a = positions[corners.x].high, b = positions[corners.y].high, c = positions[corners.z].high;
  vec3 low = min(a, min(b, c)), high = max(a, max(b, c));
  vec3 centre = 0.5 * (low + high);
  pair_spheres[t] = vec4(centre, max(distance(a, centre), max(distance(b, centre), distance(c, centre))));
  vec3 normal = cross(b - a, c - a);
  float area = length(normal);
  if (!is_edge && area > 0.0) {
    ivec3 unit = ivec3(round(normal * (4096.0 / area)));
    for (uint j = 0u; j < 3u; ++j)
      for (uint k = 0u; k < 3u; ++k) atomicAdd(pair_grid[CELLS + 3u * corners[j] + k], uint(unit[k]));
  }
  ivec3 first = cell_of(low), last = cell_of(high), across = last - first + 1;
  if (any(greaterThan(across, ivec3(most_along))) || across.x * across.y * across.z > most_cells) {
    atomicAdd(pair_lists[OVERFLOWN], 1u);
    return;
  }
  uint cells = uint(across.x * across.y * across.z), entry = atomicAdd(pair_lists[ENTRIES], cells);
  if (entry + cells > MOST_ENTRIES) {
    atomicAdd(pair_lists[OVERFLOWN], 1u);
    return;
  }
  for (int z = first.z; z <= last.z; ++z)
    for (int y = first.y; y <= last.y; ++y)
      for (int x = first.x; x <= last.x; ++x) {
        uint k = ENTRIES_AT + 3u * entry++;
        bvec3 is_first = equal(ivec3(x, y, z), first);
        pair_grid[k] = t;
        pair_grid[k + 1u] = target_body(t) | (is_first.x ? FIRST_ALONG_X : 0u) | (is_first.y ? FIRST_ALONG_X << 1 : 0u) | (is_first.z ? FIRST_ALONG_X << 2 : 0u);
        pair_grid[k + 2u] = atomicExchange(pair_grid[hash_of(ivec3(x, y, z) + (is_edge ? edge_cells : ivec3(0)))], entry);
      }
}
