// What pairs do to their vertices in a substep: impulses and pushes, by the shares that they asked for a substep ago.
// There is an invocation per pair.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = PAIR_GROUP) in;
#include "contact/bodies/pairs.glsl"
#include "contact/bodies/belonging.glsl"
#include "contact/bodies/pair_friction.glsl"
uniform uint side;         // of vertices' shares: this substep's
uniform float push_limit;  // offsets in a substep
shared uint touching, nearest;
#if RIGID_CONTACT
#include "contact/bodies/hard.glsl"
layout(std430) restrict buffer HardPairs {
  uint hard_count;
  uint _0, _1, _2;
  HardPair hard_pairs[];
};
// Leaves a pair of which a side is a rigid body to hard.comp.
void leave_to_hard(uint p, PairState s, Proximity t, SurfacePair pair, uvec2 bodies, bool acts, uint asked[4]) {
  uint m = atomicAdd(hard_count, 1u);
  if (m >= uint(hard_pairs.length())) return;
  HardPair c;
  c.pair = p, c.acts = acts ? 1u : 0u;
  c.normal = t.normal, c.distance = t.distance, c.offset = pair.offset;
  c.least = -max(0.0, t.distance - pair.offset), c.friction = friction_between(s.vertices[0], s.vertices[3]);
  c.restitution = restitution_between(s.vertices[0], s.vertices[3]);
  c.soft_way = vec3(0.0), c.soft_weight = 0.0;
  c.impulse = c.before = vec3(pair.impulse[0], pair.impulse[1], pair.impulse[2]), c.more = vec3(0.0);
  int own = (pair.first & OF_EDGES) != 0u ? 2 : 1;
  vec3 arms[2] = vec3[2](vec3(0.0), vec3(0.0));
  for (int k = 0; k < 4; ++k) {
    int side = k < own ? 0 : 1;
    float b = t.weights[k];
    if (bodies[side] != NONE) {
      arms[side] += abs(b) * arm_at_start(bodies[side], s.vertices[k], s.ways[k]);
    } else {
      c.soft_way += b * s.ways[k];
      uint share = share_of(pair.shares, k);
      if (share != 0u) c.soft_weight += b * b * s.weights[k] * float(asked[k]) / float(share);
    }
  }
  // Both sides have the impulse at the same point, or it would turn them.
  float part = bodies.x != NONE && bodies.y != NONE ? 0.5 : 1.0;
  for (int side = 0; side < 2; ++side) {
    c.bodies[side] = bodies[side];
    c.arms[side] = vec4(arms[side] + (side == 0 ? -part : part) * t.distance * t.normal, 0.0);
    if (bodies[side] != NONE) atomicAdd(rigid_bodies[bodies[side]].hard.pairs, 1u);
  }
  hard_pairs[m] = c;
}
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
  bool acts = counts_now && pair.shares != 0u;
#if RIGID_CONTACT
  uvec2 bodies = uvec2(hard_body_of(s.vertices[0]), hard_body_of(s.vertices[3]));
  bool is_hard = bodies != uvec2(NONE);
  if (is_hard && (acts || pair.push > 0.0)) leave_to_hard(p, s, t, pair, bodies, acts, asked);
  if (is_hard) push = pair.push;
#else
  const bool is_hard = false;
#endif
  if (acts) {
    if (!is_hard) push = act(s, t, pair.shares, asked, pair.offset);
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
