// Counts the guards that triggered, where a run asks for it ($COUNT_GUARDS).
#if $COUNT_GUARDS
layout(binding = BIND_GUARDS) uniform atomic_uint guard_counts[GUARDS];
void count_guards(uint guards) {
  if (guards == 0u) return;
  if ((guards & GUARD_DIRECTION) != 0u) atomicCounterIncrement(guard_counts[0]);
  if ((guards & GUARD_HINGE) != 0u) atomicCounterIncrement(guard_counts[1]);
  if ((guards & GUARD_ANGLE) != 0u) atomicCounterIncrement(guard_counts[2]);
  if ((guards & GUARD_FLOOR) != 0u) atomicCounterIncrement(guard_counts[3]);
  if ((guards & GUARD_COLLAPSED) != 0u) atomicCounterIncrement(guard_counts[4]);
  if ((guards & GUARD_LIMIT) != 0u) atomicCounterIncrement(guard_counts[5]);
  if ((guards & GUARD_NOT_FINITE) != 0u) atomicCounterIncrement(guard_counts[6]);
}
#else
void count_guards(uint guards) {}
#endif
