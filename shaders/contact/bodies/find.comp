// Lists candidates for pairs: of two leaves that are near each other, all vertices and triangles and all edges whose
// balls are, unless a plane shows that they are further apart. There is a work-group per pair of leaves.
#include "types.glsl"
layout(local_size_x = FIND_GROUP) in;
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#include "contact/bodies/proximity.glsl"
#include "contact/bodies/reach.glsl"
#include "contact/bodies/listed.glsl"
#define WITHOUT_CHECK
#define WITHOUT_VELOCITIES
#include "vertex_state.glsl"
layout(std430) restrict readonly buffer LeafPairs { uvec2 leaf_pairs[]; };
layout(std430) restrict readonly buffer Balls { vec4 balls[]; };
layout(std430) restrict writeonly buffer Candidates { uvec2 candidates[]; };
#define MOST 192u  // parts of a kind in a leaf
#define ROUND (32u * FIND_GROUP)
#define IS_VERTEX 0
#define IS_TRIANGLE 1
#define IS_EDGE 2
shared uint parts[2][MOST];  // of both leaves, that are near the other leaf
shared vec4 near_balls[2][MOST];
shared uint part_count[2], found, first_found;
float reach, most_apart;  // m, between balls; between what may be a pair
uvec2 parts_of_leaf(int kind, uint leaf) {
  if (kind == IS_VERTEX) return uvec2(leaves[leaf].vertices[0], leaves[leaf].vertices[1]);
  if (kind == IS_TRIANGLE) return uvec2(leaves[leaf].triangles[0], leaves[leaf].triangles[1]);
  return uvec2(leaves[leaf].edges[0], leaves[leaf].edges[1]);
}
uint part_at(int kind, uint at) {
  return kind == IS_VERTEX ? leaf_vertices[at] : kind == IS_TRIANGLE ? leaf_triangles[at] : leaf_edges[at];
}
void keep_near(int side, int kind, uint leaf, uint other) {
  uvec2 range = parts_of_leaf(kind, leaf);
  uint first_ball = kind == IS_VERTEX ? 0u : kind == IS_TRIANGLE ? FIRST_BALL_OF_TRIANGLES : FIRST_BALL_OF_EDGES;
  vec3 low = leaf_lows[other].xyz - reach, high = leaf_highs[other].xyz + reach;
  for (uint at = range.x + lane(); at < range.y; at += FIND_GROUP) {
    vec4 ball = balls[first_ball + at];
    if (!overlap(ball.xyz - ball.w, ball.xyz + ball.w, low, high)) continue;
    uint slot = atomicAdd(part_count[side], 1u);
    parts[side][slot] = part_at(kind, at);
    near_balls[side][slot] = ball;
  }
}
bool are_balls_near(uint a, uint b, bool once) {
  vec4 p = near_balls[0][a], q = near_balls[1][b];
  return distance(p.xyz, q.xyz) <= p.w + q.w + reach && !(once && parts[0][a] >= parts[1][b]);
}
// Looks at their distance along the shortest way from one to the other: along no way are they further apart.
bool may_be_pair(uvec2 candidate) {
  bool of_edges = (candidate.x & OF_EDGES) != 0u;
  uvec4 vertices = candidate_vertices(candidate);
  vec3 x = positions[vertices.x].high, a = positions[vertices.y].high - x, b = positions[vertices.z].high - x,
       c = positions[vertices.w].high - x;
  vec3 n = of_edges ? edge_edge_proximity(a, b, c).normal : vertex_triangle_proximity(a, b, c).normal;
  float second = dot(n, a), other = max(dot(n, b), dot(n, c));
  return (of_edges ? min(0.0, second) - other : -max(second, other)) <= most_apart;
}
uvec2 candidate_at(uint a, uint b, bool of_edges, bool same_body) {
  return uvec2(parts[0][a] | (of_edges ? OF_EDGES : 0u), parts[1][b] | (same_body ? SAME_BODY : 0u));
}
void hold_candidate(uvec2 candidate) {
  uvec4 vertices = candidate_vertices(candidate);
  for (int k = 0; k < 4; ++k) hold(vertices[k], 0.0);
}
// All pairs of parts of one kind in a leaf and of another in the other leaf. Whether any of the latter is near.
bool search(int kind, uint leaf, int other_kind, uint other) {
  barrier();
  if (lane() < 2u) part_count[lane()] = 0u;
  if (lane() == 2u) found = 0u;
  barrier();
  keep_near(0, kind, leaf, other);
  keep_near(1, other_kind, other, leaf);
  barrier();
  bool of_edges = kind == IS_EDGE, once = of_edges && leaf == other;
  bool same_body = leaves[leaf].body == leaves[other].body;
  uint own_count = part_count[0], count = own_count * part_count[1];
  for (uint base = 0u; base < count; base += ROUND) {
    uint first = base + lane(), a = first % own_count, b = first / own_count, near = 0u, kept = 0u;
    for (uint k = 0u; k < 32u && first + k * FIND_GROUP < count; ++k) {
      if (are_balls_near(a, b, once)) near |= 1u << k;
      a += FIND_GROUP % own_count, b += FIND_GROUP / own_count;
      if (a >= own_count) a -= own_count, ++b;
    }
    for (; near != 0u; near &= near - 1u) {
      uint both = first + uint(findLSB(near)) * FIND_GROUP;
      if (may_be_pair(candidate_at(both % own_count, both / own_count, of_edges, same_body))) kept |= near & -near;
    }
    uint slot = kept != 0u ? atomicAdd(found, uint(bitCount(kept))) : 0u;
    barrier();
    if (lane() == 0u && found > 0u) {
      first_found = atomicAdd(counts.candidates, found);
      atomicMax(totals.most_candidates, first_found + found);
      NEED_GROUPS(counts.candidate_groups, (first_found + found - 1u) / GROUP_SIZE + 1u)
      found = 0u;
    }
    barrier();
    slot += first_found;
    for (; kept != 0u; kept &= kept - 1u) {
      uint both = first + uint(findLSB(kept)) * FIND_GROUP;
      uvec2 candidate = candidate_at(both % own_count, both / own_count, of_edges, same_body);
      if (slot < uint(candidates.length())) candidates[slot] = candidate;
      else hold_candidate(candidate);
      ++slot;
    }
    barrier();
  }
  return part_count[1] > 0u;
}
void main() {
  uint number = group_index();
  if (number >= min(counts.leaf_pairs, uint(leaf_pairs.length()))) return;
  uvec2 both = leaf_pairs[number];
  float offset = leaf_offset(both.x, both.y), approach = approach_between(both.x, both.y),
        crossing = way_of_both(limit_of(leaf_highs[both.x].w), limit_of(leaf_highs[both.y].w));
  // As list.comp finds it, with some room for rounding.
  most_apart = 1.01 * max(crossing, offset + SPARE * crossing + approach * (lifetime + AHEAD * params.h));
  reach = min(most_apart, offset + further_than_offset(both.x, both.y));
  // Edges and vertices are near only where triangles are.
  if (!search(IS_VERTEX, both.x, IS_TRIANGLE, both.y)) return;
  if (both.x != both.y && !search(IS_VERTEX, both.y, IS_TRIANGLE, both.x)) return;
  search(IS_EDGE, both.x, IS_EDGE, both.y);
}
