// How fast what each leaf may meet is: what is hit goes on as fast. There is a work-group per leaf.
#include "types.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#include "contact/bodies/proximity.glsl"
#include "contact/bodies/reach.glsl"
shared uint fastest;
void main() {
  uint leaf = group_index();
  if (leaf >= LEAVES) return;
  float own = leaf_lows[leaf].w;
  if (lane() == 0u) fastest = floatBitsToUint(own);
  barrier();
  for (uint l = lane(); l < LEAVES; l += GROUP_SIZE) {
    float other = leaf_lows[l].w;
    float way = way_until_then(other), reach = leaf_offset(leaf, l) + further_than_offset(leaf, l, way, way);
    if (other > own && may_touch(leaf, l) && are_near(leaf, l, reach)) atomicMax(fastest, floatBitsToUint(other));
  }
  barrier();
  if (lane() == 0u) leaf_highs[leaf].w = uintBitsToFloat(fastest);
}
