// Which of its candidates each item is in, and how many contacts every vertex is part of. CANDIDATES invocations per record, one for each candidate.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
#include "pairs/formulas.glsl"
#include "pairs/meeting.glsl"
const float none = 1e30;
shared float ranks[GROUP_SIZE], pushing_ranks[GROUP_SIZE], gaps[GROUP_SIZE];
void main() {
  uint own_lane = gl_LocalInvocationIndex, first = own_lane / CANDIDATES * CANDIDATES, lane = own_lane - first;
  uint record = group_index() * (GROUP_SIZE / CANDIDATES) + own_lane / CANDIDATES, k = RECORDS_AT + RECORD * record;
  bool there = record < pair_lists[RECORDS];
  uint s = there ? pair_lists[k] : 0u, t = there ? pair_lists[k + 2u + lane] : NONE;
  Meeting m;
  m.gap = m.rank = none;
  bool pushes = t != NONE && (t & BESIDE) == 0u;
  if (t != NONE) m = meeting_of(s, t);
  ranks[own_lane] = m.rank, pushing_ranks[own_lane] = pushes ? m.rank : none, gaps[own_lane] = m.gap;
  barrier();
  uint nearest = first, least = first;
  for (uint c = first + 1u; c < first + CANDIDATES; ++c) {
    if (ranks[c] < ranks[nearest]) nearest = c;
    if (pushing_ranks[c] < pushing_ranks[least]) least = c;
  }
  if (!there || own_lane != least) return;
  bool in_it = pushes && m.rank < none && m.gap < 0.0 && gaps[nearest] <= 0.0;
  pair_lists[k + 1u] = pair_lists[HELD + s] = in_it ? t : NONE;
  if (!in_it) return;
  pair_lists[DEPTHS + s] = floatBitsToUint(-m.gap);
  uvec4 vertices = vertices_of(s, t & TARGET);
  for (uint j = 0u; j < 4u; ++j)
    if (m.weights[j] != 0.0) atomicAdd(pair_sums[8u * vertices[j] + 3u], 1);
  atomicAdd(pair_lists[TOUCHING], 1u);
  atomicMax(pair_lists[DEEPEST], floatBitsToUint(-m.gap));
}
