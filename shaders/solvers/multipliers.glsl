// The multipliers that XPBD keeps of each constraint from one iteration of a substep to the next (method.md eq. 17).
#if COMPLIANT
layout(std430) restrict buffer Multipliers { float multipliers[]; };  // one for each pair of a record's words
float last_multiplier(uint record) { return (phases & PHASE_PREDICT) == 0u ? multipliers[record] : 0.0; }
void keep_multiplier(uint record, float lambda) {
  if ((phases & PHASE_FINISH) == 0u) multipliers[record] = lambda;
}
#endif
#define NOTE_STIFFNESS(value)
