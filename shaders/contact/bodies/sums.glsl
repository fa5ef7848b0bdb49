#ifndef SUM_PARTS  // push.comp needs it twice
#define SUM_PARTS 32.0  // of a quantum
#include "contact/bodies/layout.glsl"
layout(std430) restrict buffer PairSums {
  int sharing[2 * VERTICES];  // how many contacts share each vertex, those of the one substep and of the next in turn
  ContactSums contact_sums[];
};
uint shared_at(uint vertex, uint side) { return 2u * vertex + side; }
#endif
