// Tests bits, since compilers may assume that no NaN exists.
bool is_finite(vec3 v) {
  const uint exponent = 0x7f800000u;
  return all(lessThan(floatBitsToUint(v) & exponent, uvec3(exponent)));
}
