#ifndef SUM_PARTS  // push.comp includes it twice
#define SUM_PARTS 32.0  // of a quantum
#include "contact/bodies/layout.glsl"
layout(std430) restrict buffer PairSums {
  int sharing[2 * VERTICES];  // by vertex the number of its contacts, on two sides that alternate between substeps
  ContactSums contact_sums[];
};
uint shared_at(uint vertex, uint side) { return 2u * vertex + side; }
#endif
