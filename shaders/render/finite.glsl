// Tests bits, since compilers may assume that no NaN exists. Beyond 1e7 m products with a matrix would overflow.
bool finite(vec3 p) {
  uvec3 bits = floatBitsToUint(p) & 0x7fffffffu;
  return all(lessThan(bits, uvec3(0x4b189680u)));
}
