// What pairs of surfaces do to their vertices (method.md eq. 61): forces where Newton starts (PRESS_AT 0) and where the
// last iteration ends (2), with which the next substep begins, and the pairs' part of a product A z (1). One invocation
// per pair.
#include "types.glsl"
layout(local_size_x = PAIR_GROUP) in;
#include "contact/bodies/lists.glsl"
#include "contact/bodies/proximity.glsl"
#include "contact/bodies/pair_friction.glsl"
layout(std430) restrict buffer Pairs { SurfacePair pairs[]; };
#include "solvers/newton/words.glsl"
#include "solvers/newton/press.glsl"
#include "solvers/newton/pressed.glsl"
const float kept_friction = 0.25;
vec3 moved_by(uint i) { return at(PRESS_AT == 1 ? SEARCH : MOVED, i).xyz; }
void add_force(uint i, vec3 force, float quantum) {
  for (uint c = 0u; c < 3u; ++c) {
    float high = round(clamp(force[c] / quantum, -5e8, 5e8));
    int low = int(round((force[c] - high * quantum) * (LOW_QUANTA / quantum)));
    if (high != 0.0) atomicAdd(words[word_of(PRESS, i) + c], int(high));
    if (low != 0) atomicAdd(words[word_of(PRESS_LOW, i) + c], low);
  }
}
void main() {
  uint p = group_index() * PAIR_GROUP + lane();
  if (p >= min(counts.pairs, uint(pairs.length()))) return;
  Press c = presses[p];
  if (!(c.stiffness > 0.0)) return;
  uvec4 vertices = pairs[p].vertices;
  float b[4] = weights_of(c, (pairs[p].first & OF_EDGES) != 0u), quantum = press_quantum();
  vec3 n = pairs[p].normal.xyz, way = vec3(0.0);
  for (int k = 0; k < 4; ++k) way += b[k] * moved_by(vertices[k]);
  float along = dot(n, way);
  vec3 slip = way - along * n;
#if PRESS_AT == 1
  vec3 force = c.stiffness * along * n + c.grip * slip;
#else
  float push = c.stiffness * (c.start - along);
  vec3 friction = vec3(pairs[p].impulse[0], pairs[p].impulse[1], pairs[p].impulse[2]) - c.grip * slip;
  vec3 force = push * n + friction;
#endif
  for (int k = 0; k < 4; ++k)
    if (b[k] != 0.0) add_force(vertices[k], b[k] * force, quantum);
#if PRESS_AT == 2
  push = max(0.0, push);
  // Where it sticks, friction follows slowly, as on obstacles.
  vec3 before = vec3(pairs[p].impulse[0], pairs[p].impulse[1], pairs[p].impulse[2]);
  bool slips = c.grip < 0.99 * c.stiffness;
  friction = mix(before, friction, slips ? 1.0 : kept_friction);
  float limit = friction_between(vertices[0], vertices[3]) * push, size = length(friction);
  if (size > limit) friction *= limit / size;
  for (int k = 0; k < 3; ++k) pairs[p].impulse[k] = friction[k];
  pairs[p].push = push;
  for (int k = 0; k < 4; ++k) atomicMax(words[word_of(OWN, vertices[k]) + 3u], floatBitsToInt(push / c.stiffness));
#endif
}
