// Boxes around leaves and the speeds of their vertices; with `detects`, vertices also forget their pairs. There is a
// work-group per leaf.
#include "types.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#define WITHOUT_CHECK
#include "vertex_state.glsl"
layout(std430) restrict buffer PairSumsByVertex { PairSums pair_sums[]; };
layout(std430) restrict writeonly buffer Listed { uvec4 listed[]; };  // by vertex: where pairs were found; its limit
uniform bool detects;
shared vec3 lows[GROUP_SIZE];
shared vec4 highs[GROUP_SIZE];  // w: m/s
void forget_pairs(uint i) {
  listed[i] = uvec4(floatBitsToUint(positions[i].high), floatBitsToUint(1e30));
  for (int c = 0; c < 3; ++c) pair_sums[i].stopped[c] = pair_sums[i].pushed[c] = pair_sums[i].turned[c] = 0;
  pair_sums[i].part = floatBitsToUint(1.0);
  pair_sums[i].asked[0] = pair_sums[i].asked[1] = pair_sums[i].pairs = pair_sums[i].left = 0u;
}
void main() {
  uint leaf = group_index();
  if (leaf >= LEAVES) return;
  vec3 low = vec3(1e30);
  vec4 high = vec4(vec3(-1e30), 0.0);
  for (uint t = leaves[leaf].triangles[0] + lane(); t < leaves[leaf].triangles[1]; t += GROUP_SIZE)
    for (int c = 0; c < 3; ++c) {
      uint i = triangles[leaf_triangles[t]][c];
      low = min(low, positions[i].high);
      high = max(high, vec4(positions[i].high, length(velocities[i].high)));
    }
  if (detects)
    for (uint s = leaves[leaf].vertices[0] + lane(); s < leaves[leaf].vertices[1]; s += GROUP_SIZE)
      forget_pairs(leaf_vertices[s]);
  lows[lane()] = low, highs[lane()] = high;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane() < half_size) {
      lows[lane()] = min(lows[lane()], lows[lane() + half_size]);
      highs[lane()] = max(highs[lane()], highs[lane() + half_size]);
    }
    barrier();
  }
  if (lane() == 0u) leaf_lows[leaf] = vec4(lows[0], highs[0].w), leaf_highs[leaf] = vec4(highs[0].xyz, 0.0);
}
