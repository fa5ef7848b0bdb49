// Vectors as words, to which several invocations may add integers.
#include "solvers/newton/layout.glsl"
layout(std430) restrict buffer Vectors { int words[]; };
uint word_of(uint slot, uint i) { return 4u * (slot * VERTICES + i); }
vec4 at(uint slot, uint i) {
  uint k = word_of(slot, i);
  return intBitsToFloat(ivec4(words[k], words[k + 1u], words[k + 2u], words[k + 3u]));
}
