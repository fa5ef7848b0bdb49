// What pairs do to their vertices in a substep: impulses and pushes, by the shares that they asked for a substep ago.
// There is an invocation per pair.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = PAIR_GROUP) in;
#include "contact/bodies/pairs.glsl"
#include "contact/bodies/belonging.glsl"
#include "contact/friction.glsl"
uniform uint side;         // of vertices' shares: this substep's
uniform float push_limit;  // offsets in a substep
shared uint touching, nearest;
#if BODY_FRICTION
float friction_between(uint a, uint b) { return mean_friction(body_friction(a), body_friction(b)); }
#else  // with a mean of equal values the compiler would round what follows differently
float friction_between(uint a, uint b) { return params.friction; }
#endif
// Adds what the pair does now, and returns its push.
float act(PairState s, Proximity t, uint shares, uint asked[4], float offset) {
  float split[4];
  for (int k = 0; k < 4; ++k)
    split[k] = s.weights[k] * float(asked[k]) / float(share_of(shares, k));
  Meeting m = meet(t, s.ways, split, s.turns);
  if (!(m.weight > 0.0)) return 0.0;
  float stop = stopping_impulse(t, m, offset), push = push_apart(t, m, offset, push_limit);
  float slip = slip_impulse(m, stop, friction_between(s.vertices[0], s.vertices[3]));
  for (int k = 0; k < 4; ++k) {
    ivec3 stopped = to_quanta(s.weights[k] * impulse_on(k, t, m, stop, slip, s.turns)),
          pushed = to_quanta(s.weights[k] * t.weights[k] * push * t.normal);
    for (int c = 0; c < 3; ++c) {
      if (stopped[c] != 0) atomicAdd(pair_sums[s.vertices[k]].stopped[c], stopped[c]);
      if (pushed[c] != 0) atomicAdd(pair_sums[s.vertices[k]].pushed[c], pushed[c]);
    }
  }
  return push;
}
void meet_pair(uint p) {
  SurfacePair pair = pairs[p];
  bool of_edges = (pair.first & OF_EDGES) != 0u;
  PairState s = state_of(pair.vertices);
  uint asked[4];
  for (int k = 0; k < 4; ++k) asked[k] = pair_sums[s.vertices[k]].asked[side];
  Proximity t = proximity_of(s.places, of_edges);
  bool soon = touches_soon(t, s.ways, pair.offset);
  bool counts_now = (soon || pair.shares != 0u) && belongs(t, of_edges, pair.first & ~OF_EDGES, pair.second);
  float push = 0.0;
  if (counts_now && pair.shares != 0u) {
    push = act(s, t, pair.shares, asked, pair.offset);
    atomicAdd(touching, 1u);
    atomicMin(nearest, floatBitsToUint(t.distance / pair.offset));
  }
  uint shares = counts_now && soon ? packed_shares(t) : 0u;
  if (shares != 0u)
    for (int k = 0; k < 4; ++k) atomicAdd(pair_sums[s.vertices[k]].asked[1u - side], share_of(shares, k));
  pairs[p].normal = vec4(t.normal, t.distance), pairs[p].push = push, pairs[p].shares = shares;
}
void main() {
  if (lane() == 0u) touching = 0u, nearest = floatBitsToUint(1e30);
  barrier();
  uint p = group_index() * PAIR_GROUP + lane();
  if (p < min(counts.pairs, uint(pairs.length()))) meet_pair(p);
  barrier();
  if (lane() == 0u && touching > 0u) atomicAdd(totals.touching, touching), atomicMin(totals.nearest, nearest);
}
