// The state of vertices, for kernels that move them.
layout(std430) buffer Positions { Position positions[]; };
layout(std430) buffer Velocities { Velocity velocities[]; };
// The first step whose state is not finite, and the lowest vertex that is not; ~0: none. Then what
// sim/adaptive_substeps.h asks for, bits of floats: the largest h^2 b (method.md eq. 39b) in mode explicit; the largest
// residual over that of Newton's start, before the last iteration, and the least length of a first step, 0 where a tet
// is inverted, in mode newton. Then what was left out.
layout(std430) buffer Check { uint bad_step, bad_vertex, largest, least, dropped[DROPS]; };
// Dispatch parameters: what this one does (PHASE_ bits; mode newton: which iteration), and the number of the step, for
// the check.
uniform uint phases;
uniform uint step_number;
#include "finite.glsl"

// Notes a vertex that is not finite. Taken almost never, so it costs a test of numbers that are in registers anyway.
void note_unless_finite(uint i, vec3 position, vec3 velocity) {
  if (!is_finite(position) || !is_finite(velocity)) {
    if (atomicMin(bad_step, step_number) >= step_number) atomicMin(bad_vertex, i);
  }
}
