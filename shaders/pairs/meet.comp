// Which of its candidates each vertex is in, and how many contacts every vertex is part of. One invocation per record.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
#include "pairs/formulas.glsl"
void main() {
  uint record = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (record >= pair_lists[RECORDS]) return;
  uint k = RECORDS_AT + RECORD * record, i = surface_vertex(pair_lists[k]), in_triangle = NONE;
  Pair own = Pair(positions[i].high, positions[i].low);
  Meeting nearest, least;
  nearest.rank = least.rank = 1e30;
  for (uint c = 0u; c < CANDIDATES; ++c) {
    uint t = pair_lists[k + 2u + c];
    if (t == NONE) break;
    bool beside = (t & BESIDE) != 0u;
    t &= ~BESIDE;
    vec3 corners[3];
    for (uint j = 0u; j < 3u; ++j) {
      Position p = positions[triangle_vertex(t, j)];
      corners[j] = relative(Pair(p.high, p.low), own);
    }
    Meeting m = meet(corners[0], corners[1], corners[2]);
    if (m.rank < nearest.rank) nearest = m;
    if (!beside && m.rank < least.rank) least = m, in_triangle = t;
  }
  least.gap -= surface_thickness(pair_lists[k]);
  if (!(least.gap < 0.0) || nearest.gap > surface_thickness(pair_lists[k])) in_triangle = NONE;
  pair_lists[k + 1u] = pair_lists[HELD + pair_lists[k]] = in_triangle;
  if (in_triangle == NONE) return;
  atomicAdd(pair_sums[8u * i + 3u], 1);
  for (uint j = 0u; j < 3u; ++j)
    if (least.weights[j] > 0.0) atomicAdd(pair_sums[8u * triangle_vertex(in_triangle, j) + 3u], 1);
  atomicAdd(pair_lists[TOUCHING], 1u);
  atomicMax(pair_lists[DEEPEST], floatBitsToUint(-least.gap));
}
