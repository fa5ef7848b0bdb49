// Boxes around leaves and the speeds of their vertices; with `detects`, also balls around their parts, and vertices
// forget their pairs. There is a work-group per leaf.
#include "types.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "ordered.glsl"
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#define WITHOUT_CHECK
#include "vertex_state.glsl"
layout(std430) restrict buffer PairSumsByVertex { PairSums pair_sums[]; };
layout(std430) restrict writeonly buffer Listed { uvec4 listed[]; };  // by vertex: where pairs were found; its limit
layout(std430) restrict writeonly buffer Balls { vec4 balls[]; };     // around parts: centre, radius
uniform bool detects;
shared vec3 lows[GROUP_SIZE];
shared vec4 highs[GROUP_SIZE];                         // w: m/s
shared vec3 slowest[GROUP_SIZE], fastest[GROUP_SIZE];  // by component
void forget_pairs(uint i) {
  listed[i] = uvec4(floatBitsToUint(positions[i].high), floatBitsToUint(1e30));
  for (int c = 0; c < 3; ++c) pair_sums[i].stopped[c] = pair_sums[i].pushed[c] = pair_sums[i].turned[c] = 0;
  pair_sums[i].part = floatBitsToUint(1.0);
  pair_sums[i].asked[0] = pair_sums[i].asked[1] = pair_sums[i].pairs = pair_sums[i].left = 0u;
}
vec4 ball_around(vec3 a, vec3 b, vec3 c) {
  vec3 centre = 0.5 * (min(a, min(b, c)) + max(a, max(b, c)));
  return vec4(centre, 1.001 * max(distance(a, centre), max(distance(b, centre), distance(c, centre))));
}
void put_balls(SurfaceLeaf leaf) {
  for (uint at = leaf.vertices[0] + lane(); at < leaf.vertices[1]; at += GROUP_SIZE) {
    uint i = leaf_vertices[at];
    forget_pairs(i);
    balls[at] = vec4(positions[i].high, 0.0);
  }
  for (uint at = leaf.edges[0] + lane(); at < leaf.edges[1]; at += GROUP_SIZE) {
    uvec2 ends = edges[leaf_edges[at]].xy;
    vec3 a = positions[ends.x].high, b = positions[ends.y].high;
    balls[FIRST_BALL_OF_EDGES + at] = ball_around(a, b, b);
  }
}
void main() {
  uint number = group_index();
  if (number >= LEAVES) return;
  SurfaceLeaf leaf = leaves[number];
  vec3 low = vec3(1e30), slow = vec3(1e30), fast = vec3(-1e30);
  vec4 high = vec4(-1e30);
  for (uint at = leaf.triangles[0] + lane(); at < leaf.triangles[1]; at += GROUP_SIZE) {
    vec3 corners[3];
    for (int c = 0; c < 3; ++c) {
      uint i = triangles[leaf_triangles[at]][c];
      vec3 v = velocities[i].high;
      corners[c] = positions[i].high;
      low = min(low, corners[c]), high = max(high, vec4(corners[c], length(v)));
      slow = min(slow, v), fast = max(fast, v);
    }
    if (detects) balls[FIRST_BALL_OF_TRIANGLES + at] = ball_around(corners[0], corners[1], corners[2]);
  }
  if (detects) put_balls(leaf);
  lows[lane()] = low, highs[lane()] = high, slowest[lane()] = slow, fastest[lane()] = fast;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane() < half_size) {
      lows[lane()] = min(lows[lane()], lows[lane() + half_size]);
      highs[lane()] = max(highs[lane()], highs[lane() + half_size]);
      slowest[lane()] = min(slowest[lane()], slowest[lane() + half_size]);
      fastest[lane()] = max(fastest[lane()], fastest[lane() + half_size]);
    }
    barrier();
  }
  if (lane() != 0u) return;
  leaf_lows[number] = vec4(lows[0], highs[0].w), leaf_highs[number] = vec4(highs[0].xyz, 0.0);
  leaf_velocities[number] = vec4(0.5 * (slowest[0] + fastest[0]), 0.5 * distance(slowest[0], fastest[0]));
  uint b = number / BRANCH;
  for (int c = 0; c < 3; ++c) {
    atomicMin(branches[b].low[c], ordered(lows[0][c]));
    atomicMax(branches[b].high[c], ordered(highs[0][c]));
  }
  atomicMax(branches[b].speed, floatBitsToUint(highs[0].w));
}
