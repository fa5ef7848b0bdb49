float[$VALUES] rest_$KIND(uint record) {
  float rest[$VALUES];
  for (uint k = 0u; k < $VALUES; ++k) rest[k] = uintBitsToFloat(mesh[record + $ARITY + k]);
  return rest;
}
