// How far from each other parts of two leaves make pairs.
uniform float lifetime;      // s, until the next detection
uniform float least_limit;   // m
uniform float most_limit;    // m
// m, that a vertex may go until then, of a leaf whose vertices are, or are hit by what is, so fast.
float way_until_then(float speed) {
  return max(least_limit, (1.6 * speed + length(params.gravity) * lifetime) * lifetime);
}
// What is so fast that it would have too many pairs is held up where it may meet others.
float limit_of(float speed) { return min(way_until_then(speed), most_limit); }
// m: what both may go, and the way of the substeps before which a pair that will touch gets its share.
float further_than_offset(uint a, uint b, float way, float other_way) {
  return 1.02 * (way + other_way) + AHEAD * params.h * (leaf_lows[a].w + leaf_lows[b].w);
}
float further_than_offset(uint a, uint b) {
  return further_than_offset(a, b, limit_of(leaf_highs[a].w), limit_of(leaf_highs[b].w));
}
float leaf_offset(uint a, uint b) { return min(leaves[a].offset, leaves[b].offset); }
bool are_near(uint a, uint b, float reach) {
  return overlap(leaf_lows[a].xyz - reach, leaf_highs[a].xyz + reach, leaf_lows[b].xyz, leaf_highs[b].xyz);
}
bool may_touch(uint a, uint b) { return CONTACT_SELF != 0 || leaves[a].body != leaves[b].body; }
