// By vertex what contact adds up: of what stops it (x 3) and of what pushes it beside (x 3), in 32nds of a quantum, and how many ask where it is. Behind
// these how many contacts share it, those of the one substep and of the next in turn.
#ifndef PARTS  // push.comp needs it twice
layout(std430, binding = BIND_PAIR_SUMS) restrict buffer PairSums { int pair_sums[]; };
#define PARTS 32.0
uint sums_of(uint vertex) { return 7u * vertex; }
#define PUSHED 3u
#define ASKS 6u
uint sharing(uint vertex, uint side) { return 7u * params.vertex_count + 2u * vertex + side; }
#endif
