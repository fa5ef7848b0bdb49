// Impulses of hard bodies' pairs, or forces of pairs in implicit steps, from one list of pairs to the next: a table by
// the numbers of both parts, by open addressing. There is an invocation per pair.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = PAIR_GROUP) in;
#include "contact/bodies/lists.glsl"
layout(std430) restrict buffer Pairs { SurfacePair pairs[]; };
layout(std430) restrict buffer KeptImpulses {
  uint kept_count;
  uint _0, _1, _2;
  KeptImpulse kept[];
};
uniform uint takes_up;  // 1: pairs take their impulses from the table, 0: they go there
uint place_of(uint first, uint second) {
  uint hash = (first * 0x9e3779b1u) ^ (second * 0x85ebca77u);
  return (hash ^ (hash >> 15)) % uint(kept.length());
}
bool is_full() { return kept_count > uint(kept.length()) / 4u * 3u; }  // then none is taken up
void put_in(uint p) {
  if (pairs[p].push == 0.0) return;
  if (atomicAdd(kept_count, 1u) >= uint(kept.length())) return;
  uint first = pairs[p].first, second = pairs[p].second, at = place_of(first, second);
  while (atomicCompSwap(kept[at].used, 0u, 1u) != 0u) at = (at + 1u) % uint(kept.length());
  kept[at].first = first, kept[at].second = second, kept[at].size = pairs[p].push;
  for (int c = 0; c < 3; ++c) kept[at].impulse[c] = pairs[p].impulse[c];
}
void take_up(uint p) {
  if (kept_count == 0u || is_full()) return;
  uint first = pairs[p].first, second = pairs[p].second;
  for (uint at = place_of(first, second); kept[at].used != 0u; at = (at + 1u) % uint(kept.length())) {
    if (kept[at].first != first || kept[at].second != second) continue;
    pairs[p].push = kept[at].size;
    for (int c = 0; c < 3; ++c) pairs[p].impulse[c] = kept[at].impulse[c];
    return;
  }
}
void main() {
  uint p = group_index() * PAIR_GROUP + lane();
  if (p >= min(counts.pairs, uint(pairs.length()))) return;
  if (takes_up != 0u) take_up(p);
  else put_in(p);
}
