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
// m, nearer than which parts must be a pair, as they could cross.
float way_of_both(float way, float other_way) { return 1.02 * (way + other_way); }
#define SPARE 0.2  // of what both may go, for those that begin to approach before the next detection
// m/s, that parts of two leaves approach each other by at most.
float approach_between(uint a, uint b) {
  vec4 one = leaf_velocities[a], other = leaf_velocities[b];
  return distance(one.xyz, other.xyz) + one.w + other.w;
}
// m: that, and the way of the substeps before which a pair that will touch gets its share.
float further_than_offset(uint a, uint b, float way, float other_way) {
  return way_of_both(way, other_way) + AHEAD * params.h * approach_between(a, b);
}
float further_than_offset(uint a, uint b) {
  return further_than_offset(a, b, limit_of(leaf_highs[a].w), limit_of(leaf_highs[b].w));
}
float leaf_offset(uint a, uint b) { return min(leaves[a].offset, leaves[b].offset); }
bool are_near(uint a, uint b, float reach) {
  return overlap(leaf_lows[a].xyz - reach, leaf_highs[a].xyz + reach, leaf_lows[b].xyz, leaf_highs[b].xyz);
}
bool may_touch(uint a, uint b) { return CONTACT_SELF != 0 || leaves[a].body != leaves[b].body; }
#ifdef VISITS_LEAVES
#include "ordered.glsl"
shared uint near_branches[GROUP_SIZE], near_count;
// What a kernel does with a leaf and one that may touch it, of a branch that is near.
void visit(uint leaf, uint other);
// m/s, the most that the kernel knows of a branch's leaves: of their vertices, or of what these may meet.
float branch_speed(uint branch);
void visit_near_leaves(uint leaf, float own_speed) {
  for (uint base = 0u; base < BRANCHES; base += GROUP_SIZE) {
    if (lane() == 0u) near_count = 0u;
    barrier();
    uint b = base + lane();
    if (b < BRANCHES) {
      float speed = max(own_speed, branch_speed(b)), way = way_until_then(speed);
      float reach = leaves[leaf].offset + way_of_both(way, way) + 2.0 * AHEAD * params.h * speed;
      vec3 low, high;
      for (int c = 0; c < 3; ++c) low[c] = decoded(branches[b].low[c]), high[c] = decoded(branches[b].high[c]);
      if (overlap(leaf_lows[leaf].xyz - reach, leaf_highs[leaf].xyz + reach, low, high))
        near_branches[atomicAdd(near_count, 1u)] = b;
    }
    barrier();
    for (uint at = lane(); at < BRANCH * near_count; at += GROUP_SIZE) {
      uint other = near_branches[at / BRANCH] * BRANCH + at % BRANCH;
      if (other < LEAVES && may_touch(leaf, other)) visit(leaf, other);
    }
    barrier();
  }
}
#endif
