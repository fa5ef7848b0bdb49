// Joins bodies that press each other to islands, of which each is solved as one system: the first of each is its name.
// One work-group.
#define WITHOUT_VELOCITIES
#define WITHOUT_CHECK
#include "solvers/newton/newton.glsl"
#include "solvers/newton/touches.glsl"
shared uint names[BODIES], changes;
uint first_beside(uint b) {
  uint first = names[b];
  for (uint w = 0u; w < TOUCH_WORDS; ++w)
    for (uint bits = touches[b * TOUCH_WORDS + w]; bits != 0u; bits &= bits - 1u)
      first = min(first, names[32u * w + uint(findLSB(bits))]);
  return min(first, names[first]);
}
void main() {
  uint lane = gl_LocalInvocationIndex;
  for (uint b = lane; b < BODIES; b += GROUP_SIZE) names[b] = b;
  if (lane == 0u) changes = 1u;
  barrier();
  for (uint turn = 0u; turn < BODIES; ++turn) {
    bool goes_on = changes == turn + 1u;
    barrier();
    if (goes_on)
      for (uint b = lane; b < BODIES; b += GROUP_SIZE) {
        uint first = first_beside(b);
        if (first < names[b]) names[b] = first, changes = turn + 2u;
      }
    barrier();
  }
  for (uint b = lane; b < BODIES; b += GROUP_SIZE) {
    islands[b] = names[b];
    for (uint w = 0u; w < TOUCH_WORDS; ++w) touches[b * TOUCH_WORDS + w] = 0u;
  }
}
