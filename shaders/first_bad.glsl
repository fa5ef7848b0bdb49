// Notes a vertex whose state is not finite under its step, the lowest one if there are several. Taken almost never, so it costs a
// test of numbers that are in registers anyway.
#include "finite.glsl"
layout(std430, binding = BIND_CHECK) buffer Check {
  uint first_bad;               // of any step: what guards the kept state
  uint step_bad[CHECK_STEPS];   // by step modulo CHECK_STEPS; ~0: none
};

void note_unless_finite(uint i, uint step_slot, vec3 position, vec3 velocity) {
  if (!is_finite(position) || !is_finite(velocity)) {
    atomicMin(first_bad, i);
    atomicMin(step_bad[step_slot], i);
  }
}
