// Books what fibres gain where their activations change, as work on the first vertex; one work-group for all of them.
#include "types.glsl"
#include "double_single.glsl"
#define ACTIVATE_SIZE 256
layout(local_size_x = ACTIVATE_SIZE) in;
#include "held.glsl"
layout(std430) restrict readonly buffer Before { float before[]; };  // activations, of the step before
shared float sums[ACTIVATE_SIZE];
void main() {
  uint me = gl_LocalInvocationIndex;
  float sum = 0.0;
  for (uint k = me; k < count; k += ACTIVATE_SIZE) {
    uint number = fibres_of(k);
    if (activation_of(number) != before[number])
      sum += held_energy(k, 0.0, activation_of(number)) - held_energy(k, 0.0, before[number]);
  }
  sums[me] = sum;
  barrier();
  for (uint half_size = ACTIVATE_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (me < half_size) sums[me] += sums[me + half_size];
    barrier();
  }
  if (me == 0u) velocities[0].work += sums[0];
}
