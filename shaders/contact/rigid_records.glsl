// The records of hard bodies that move as rigid ones. They have two sides, of which one is read and the other written,
// in turn.
#ifndef RIGID_ACCESS
#define RIGID_ACCESS
#endif
layout(std430) RIGID_ACCESS buffer RigidBodies {
  RigidRecord rigid_bodies[BODY_COUNT];
  uint near[];  // by side and body the vertices that will be in an obstacle after the next substep, in any order
};

uint side_now() { return (phases & PHASE_SIDE) != 0u ? 1u : 0u; }
uint body_of(uint i) {  // the last that starts at vertex i or before
  uint low = 0u, high = BODY_COUNT;
  while (low + 1u < high) {
    uint middle = (low + high) / 2u;
    if (rigid_bodies[middle].first <= i) low = middle;
    else high = middle;
  }
  return low;
}
// The position relative to the origin of its body.
vec3 arm_of(DoubleSingle x, vec3 origin) { return (x.high - origin) + x.low; }
