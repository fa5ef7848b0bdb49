// Where pairs were found last, and how far from there a vertex may be until they are found again: four words a vertex.
layout(std430) restrict buffer Listed { uint listed[]; };
float limit_at(uint i) { return uintBitsToFloat(listed[4u * i + 3u] & ~PAIRED); }
// A pair for which there is no room is not known to the next substeps: its vertices are held where they cannot cross
// without it.
void hold(uint i, float limit) {
  uint old = listed[4u * i + 3u];
  for (;;) {
    uint now = floatBitsToUint(min(uintBitsToFloat(old & ~PAIRED), max(limit, 1e-30))) | (old & PAIRED);
    uint was = atomicCompSwap(listed[4u * i + 3u], old, now);
    if (was == old) return;
    old = was;
  }
}
