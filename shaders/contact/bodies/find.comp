// Lists pairs that may touch before the next detection: all vertices and triangles, and all edges, of two leaves that
// are nearer to each other than their reach. There are TASKS work-groups per pair of leaves.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/pairs.glsl"
#include "contact/bodies/belonging.glsl"
#include "contact/bodies/reach.glsl"
layout(std430) restrict buffer Listed { uint listed[]; };  // four words a vertex
layout(std430) restrict readonly buffer LeafPairs { uvec2 leaf_pairs[]; };
#define MOST 192u  // parts of a kind in a leaf
#define QUEUE (8u * GROUP_SIZE)
#define IS_VERTEX 0
#define IS_TRIANGLE 1
#define IS_EDGE 2
shared uint parts[2][MOST];  // of both leaves, that are near the other leaf
shared vec4 balls[2][MOST];  // around them: centre, radius
shared uint part_count[2], queue[QUEUE], queued, found, first_found;
float further, reach;  // m, of pairs than their offset; of both leaves
uvec4 vertices_of(int kind, uint number) {
  if (kind == IS_VERTEX) return uvec4(number);
  if (kind == IS_TRIANGLE) return triangles[number].xyzz;
  return edges[number].xyyy;
}
vec4 ball_around(uvec4 v) {
  vec3 a = positions[v.x].high, b = positions[v.y].high, c = positions[v.z].high;
  vec3 centre = 0.5 * (min(a, min(b, c)) + max(a, max(b, c)));
  return vec4(centre, 1.001 * max(distance(a, centre), max(distance(b, centre), distance(c, centre))));
}
uvec2 parts_of_leaf(int kind, uint leaf) {
  if (kind == IS_VERTEX) return uvec2(leaves[leaf].vertices[0], leaves[leaf].vertices[1]);
  if (kind == IS_TRIANGLE) return uvec2(leaves[leaf].triangles[0], leaves[leaf].triangles[1]);
  return uvec2(leaves[leaf].edges[0], leaves[leaf].edges[1]);
}
uint part_at(int kind, uint at) {
  return kind == IS_VERTEX ? leaf_vertices[at] : kind == IS_TRIANGLE ? leaf_triangles[at] : leaf_edges[at];
}
void keep_near(int side, int kind, uint leaf, uint other, uint first, uint every) {
  uvec2 range = parts_of_leaf(kind, leaf);
  for (uint at = range.x + every * lane() + first; at < range.y; at += every * GROUP_SIZE) {
    uint part = part_at(kind, at);
    vec4 ball = ball_around(vertices_of(kind, part));
    float grown = ball.w + reach;
    if (!overlap(ball.xyz - grown, ball.xyz + grown, leaf_lows[other].xyz, leaf_highs[other].xyz)) continue;
    uint slot = atomicAdd(part_count[side], 1u);
    parts[side][slot] = part, balls[side][slot] = ball;
  }
}
// m, between the two parts of a pair at rest or at the start.
float given_distance(uvec4 vertices, bool of_edges, uint from) {
  vec3 given[4];
  for (int k = 0; k < 4; ++k) given[k] = (places[from + vertices[k]] - places[from + vertices[0]]).xyz;
  return proximity_of(given, of_edges).distance;
}
// Whether the two parts make a pair, which it fills in.
bool make_pair(bool of_edges, uint first, uint second, bool same_body, out SurfacePair pair) {
  uvec4 other = vertices_of(of_edges ? IS_EDGE : IS_TRIANGLE, second);
  pair.vertices = of_edges ? uvec4(edges[first].xy, other.xy) : uvec4(first, other.xyz);
  pair.first = first | (of_edges ? OF_EDGES : 0u), pair.second = second, pair.offset = 1e30;
  pair.normal = vec4(0.0), pair.push = pair._0 = pair._1 = pair._2 = 0.0, pair.shares = 0u;
  int own = of_edges ? 2 : 1;
  bool free = false;
  for (int i = 0; i < 4; ++i) {
    pair.offset = min(pair.offset, offsets[pair.vertices[i]]);
    for (int j = own; j < 4; ++j)
      if (same_body && i < own && pair.vertices[i] == pair.vertices[j]) return false;
  }
  PairState s = state_of(pair.vertices);
  for (int k = 0; k < 4; ++k) free = free || s.weights[k] > 0.0;
  Proximity t = proximity_of(s.places, of_edges);
  if (!free || t.distance > pair.offset + further) return false;
  // What is near from the start must not be pressed apart by its offset: that would be energy from nothing.
  float given = same_body ? REST_PART * given_distance(pair.vertices, of_edges, CONTACT_SELF * VERTICES)
                          : max(given_distance(pair.vertices, of_edges, 0u), LEAST_PART * pair.offset);
  pair.offset = min(pair.offset, given);
  if (t.distance > pair.offset + further) return false;
  vec3 ways[4];
  for (int k = 0; k < 4; ++k) ways[k] = params.h * velocities[pair.vertices[k]].high;
  if (touches_soon(t, ways, pair.offset) && belongs(t, of_edges, first, second)) pair.shares = packed_shares(t);
  return true;
}
void join(SurfacePair pair) {
  for (int k = 0; k < 4; ++k) {
    uint i = pair.vertices[k];
    atomicOr(listed[4u * i + 3u], PAIRED);
    atomicAdd(pair_sums[i].pairs, 1u);
    atomicAdd(pair_sums[i].left, 1u);
    if (pair.shares != 0u) atomicAdd(pair_sums[i].asked[0], share_of(pair.shares, k));
  }
}
// Tests what waits in the queue, an invocation each.
void empty_queue(uint end, bool of_edges, bool same_body) {
  for (uint base = 0u; base < end; base += GROUP_SIZE) {
    if (lane() == 0u) found = 0u;
    barrier();
    SurfacePair pair;
    bool is_pair = false;
    uint slot = 0u;
    if (base + lane() < end) {
      uint both = queue[base + lane()];
      is_pair = make_pair(of_edges, parts[0][both & 255u], parts[1][both >> 8], same_body, pair);
      if (is_pair) slot = atomicAdd(found, 1u);
    }
    barrier();
    if (lane() == 0u && found > 0u) {
      first_found = atomicAdd(counts.pairs, found);
      NEED_GROUPS(counts.pair_groups, (first_found + found - 1u) / PAIR_GROUP + 1u)
    }
    barrier();
    slot += first_found;
    if (is_pair && slot < uint(pairs.length())) {
      pairs[slot] = pair;
      join(pair);
    }
  }
  barrier();
  if (lane() == 0u) queued = 0u;
  barrier();
}
// All pairs of parts of one kind in a leaf and of another in the other leaf.
void search(int kind, uint leaf, int other_kind, uint other, uint task, bool same_body) {
  bool of_edges = kind == IS_EDGE;
  if (lane() < 2u) part_count[lane()] = 0u;
  if (lane() == 2u) queued = 0u;
  barrier();
  keep_near(0, kind, leaf, other, of_edges ? task - 2u : 0u, of_edges ? TASKS - 2u : 1u);
  keep_near(1, other_kind, other, leaf, 0u, 1u);
  barrier();
  uint own_count = part_count[0], count = own_count * part_count[1];
  for (uint base = 0u; base < count; base += GROUP_SIZE) {
    uint both = base + lane();
    if (both < count) {
      uint a = both % own_count, b = both / own_count;
      bool twice = of_edges && leaf == other && parts[0][a] >= parts[1][b];
      vec4 p = balls[0][a], q = balls[1][b];
      if (!twice && distance(p.xyz, q.xyz) <= p.w + q.w + reach) queue[atomicAdd(queued, 1u)] = a | b << 8;
    }
    barrier();
    uint waiting = queued;
    barrier();  // before others add to the queue
    if (waiting + GROUP_SIZE > QUEUE || base + GROUP_SIZE >= count) empty_queue(waiting, of_edges, same_body);
  }
}
void main() {
  uint number = group_index() / TASKS, task = group_index() % TASKS;
  if (number >= min(counts.leaf_pairs, uint(leaf_pairs.length()))) return;
  uvec2 both = leaf_pairs[number];
  bool same_body = leaves[both.x].body == leaves[both.y].body;
  further = further_than_offset(both.x, both.y);
  reach = leaf_offset(both.x, both.y) + further;
  if (task == 0u) search(IS_VERTEX, both.x, IS_TRIANGLE, both.y, task, same_body);
  else if (task == 1u && both.x != both.y) search(IS_VERTEX, both.y, IS_TRIANGLE, both.x, task, same_body);
  else if (task > 1u) search(IS_EDGE, both.x, IS_EDGE, both.y, task, same_body);
}
