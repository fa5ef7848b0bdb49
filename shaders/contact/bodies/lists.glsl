// What is found about the surfaces of bodies (method.md, "Bodies in contact"; sim/contact/pairs.h).
#include "contact/bodies/layout.glsl"
layout(std430) restrict buffer PairLists {
  vec4 leaf_lows[LEAVES];   // corners of boxes; m/s, of its fastest vertex
  vec4 leaf_highs[LEAVES];  // m/s, of the fastest that it may meet
  vec4 leaf_velocities[LEAVES];  // the middle of its vertices' velocities, m/s; how far any is from it
  ContactTotals totals;
  PairCounts counts;
  SurfaceBranch branches[BRANCHES];
};
uint lane() { return gl_LocalInvocationIndex; }
// Makes an indirect dispatch have so many work-groups, ROW of them in a row.
#define NEED_GROUPS(groups, count) \
  atomicMax(groups.x, min(count, ROW)); \
  if (count > ROW) atomicMax(groups.y, (count + ROW - 1u) / ROW);
bool overlap(vec3 low, vec3 high, vec3 other_low, vec3 other_high) {
  return all(lessThanEqual(low, other_high)) && all(greaterThanEqual(high, other_low));
}
