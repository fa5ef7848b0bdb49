// Guards of corrections, and how often each has triggered.
#if COUNT_GUARDS
layout(binding = BIND_GUARDS) uniform atomic_uint guard_counts[GUARDS];
#endif
void count_guards(uint guards) {
#if COUNT_GUARDS
  for (int g = 0; g < GUARDS; ++g)
    if ((guards & (1u << g)) != 0u) atomicCounterIncrement(guard_counts[g]);
#endif
}
// A correction that is no number is dropped, and one that is longer than the body is shortened.
vec3 limited(vec3 correction) {
  float most = FINE(params.max_correction), l = length(correction);
  bool number = l * 0.0 == 0.0;
  count_guards(!number ? GUARD_NOT_FINITE : l > most ? GUARD_LIMIT : 0u);
  if (!number) return vec3(0.0);
  return l > most ? correction * (most / l) : correction;
}
