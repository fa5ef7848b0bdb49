// Lists those candidates as pairs that may touch or cross before the next detection. There is an invocation per
// candidate.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/pairs.glsl"
#include "contact/bodies/belonging.glsl"
#include "contact/bodies/listed.glsl"
layout(std430) restrict readonly buffer Candidates { uvec2 candidates[]; };
#include "contact/bodies/reach.glsl"
shared uint found, first_found;
// m, between the two parts of a pair at rest or at the start.
float given_distance(uvec4 vertices, bool of_edges, uint from) {
  vec3 given[4];
  for (int k = 0; k < 4; ++k) given[k] = (places[from + vertices[k]] - places[from + vertices[0]]).xyz;
  return proximity_of(given, of_edges).distance;
}
// Whether the two parts make a pair, which it fills in.
bool make_pair(uvec2 candidate, out SurfacePair pair) {
  bool of_edges = (candidate.x & OF_EDGES) != 0u, same_body = (candidate.y & SAME_BODY) != 0u;
  uint first = candidate.x & ~OF_EDGES, second = candidate.y & ~SAME_BODY;
  pair.vertices = candidate_vertices(candidate);
  pair.first = candidate.x, pair.second = second, pair.offset = 1e30;
  pair.push = pair.impulse[0] = pair.impulse[1] = pair.impulse[2] = 0.0, pair.shares = 0u;
  PairState s = state_of(pair.vertices);
  int own = of_edges ? 2 : 1;
  bool free = false;
  vec2 limits = vec2(0.0);
  vec3 ways[4];
  for (int i = 0; i < 4; ++i) {
    uint vertex = pair.vertices[i];
    pair.offset = min(pair.offset, offsets[vertex]);
    if (i < own) limits.x = max(limits.x, limit_at(vertex));
    else limits.y = max(limits.y, limit_at(vertex));
    ways[i] = params.h * velocities[vertex].high;
    free = free || s.weights[i] > 0.0 || ways[i] != vec3(0.0);  // one that is pinned may be led
    for (int j = own; j < 4; ++j)
      if (same_body && i < own && vertex == pair.vertices[j]) return false;
  }
  Proximity t = proximity_of(s.places, of_edges);
  float crossing = way_of_both(limits.x, limits.y);
  float nearer = SPARE * crossing - min(0.0, approach(t, ways)) * (lifetime / params.h + AHEAD);
  if (!free || t.distance > max(crossing, pair.offset + nearer)) return false;
  // What is near from the start must not be pressed apart by its offset: that would be energy from nothing.
  float given = same_body ? REST_PART * given_distance(pair.vertices, of_edges, CONTACT_SELF * VERTICES)
                          : max(given_distance(pair.vertices, of_edges, 0u), LEAST_PART * pair.offset);
  pair.offset = min(pair.offset, given);
  if (t.distance > max(crossing, pair.offset + nearer)) return false;
  pair.normal = vec4(t.normal, t.distance);
  if (touches_soon(t, ways, pair.offset) && belongs(t, of_edges, first, second)) pair.shares = packed_shares(t);
  return true;
}
void join(SurfacePair pair) {
  for (int k = 0; k < 4; ++k) {
    uint i = pair.vertices[k];
    if ((listed[4u * i + 3u] & PAIRED) == 0u) atomicOr(listed[4u * i + 3u], PAIRED);
    atomicAdd(pair_sums[i].pairs, 1u);
    atomicAdd(pair_sums[i].left, 1u);
    if (pair.shares != 0u) atomicAdd(pair_sums[i].asked[0], share_of(pair.shares, k));
  }
}
void main() {
  if (lane() == 0u) found = 0u;
  barrier();
  uint at = group_index() * GROUP_SIZE + lane(), slot = 0u;
  SurfacePair pair;
  bool is_pair = at < min(counts.candidates, uint(candidates.length())) && make_pair(candidates[at], pair);
  if (is_pair) slot = atomicAdd(found, 1u);
  barrier();
  if (lane() == 0u && found > 0u) {
    first_found = atomicAdd(counts.pairs, found);
    atomicMax(totals.most_pairs, first_found + found);
    NEED_GROUPS(counts.pair_groups, (first_found + found - 1u) / PAIR_GROUP + 1u)
  }
  barrier();
  slot += first_found;
  if (!is_pair) return;
  if (slot < uint(pairs.length())) {
    pairs[slot] = pair;
    join(pair);
  } else {
    for (int k = 0; k < 4; ++k) hold(pair.vertices[k], 0.45 * pair.normal.w);
  }
}
