#if $VALUES == 1
float rest_$KIND(uint c) { return values_$KIND[c]; }
#else
float[$VALUES] rest_$KIND(uint c) {
  float rest[$VALUES];
  for (uint k = 0u; k < $VALUESu; ++k) rest[k] = values_$KIND[$VALUESu * c + k];
#if $DRIVEN
  rest[$VALUES - 2] -= activation_of(uint(rest[$VALUES - 1]));
#endif
  return rest;
}
#endif
