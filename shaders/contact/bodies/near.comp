// How fast what each leaf may meet is: what is hit goes on as fast. There is a work-group per leaf.
#include "types.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "contact/bodies/surfaces.glsl"
#include "contact/bodies/lists.glsl"
#include "contact/bodies/proximity.glsl"
#define VISITS_LEAVES
#include "contact/bodies/reach.glsl"
shared uint fastest;
float branch_speed(uint branch) { return uintBitsToFloat(branches[branch].speed); }
void visit(uint leaf, uint other) {
  float speed = leaf_lows[other].w;
  if (speed <= leaf_lows[leaf].w) return;
  float way = way_until_then(speed), reach = leaf_offset(leaf, other) + further_than_offset(leaf, other, way, way);
  if (are_near(leaf, other, reach)) atomicMax(fastest, floatBitsToUint(speed));
}
void main() {
  uint leaf = group_index();
  if (leaf >= LEAVES) return;
  if (lane() == 0u) fastest = floatBitsToUint(leaf_lows[leaf].w);
  barrier();
  visit_near_leaves(leaf, leaf_lows[leaf].w);
  if (lane() != 0u) return;
  leaf_highs[leaf].w = uintBitsToFloat(fastest);
  atomicMax(branches[leaf / BRANCH].fastest, fastest);
}
