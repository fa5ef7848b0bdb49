// The state of vertices, for kernels that move them.
#ifndef VERTEX_STATE
#define VERTEX_STATE
layout(std430) buffer Positions { Position positions[]; };
#ifndef WITHOUT_VELOCITIES
layout(std430) buffer Velocities { Velocity velocities[]; };
#endif
#ifndef WITHOUT_CHECK
// Values for sim/adaptive_substeps.h are bits of floats.
layout(std430) buffer Check {
  uint bad_step, bad_vertex;  // first step whose state is not finite, and its lowest such vertex; ~0: none
  uint largest;  // mode explicit: h^2 b (method.md eq. 34); mode newton: last residual over that of Newton's start
  uint least;    // mode newton: the least length of a first step, 0 where a tet is inverted
  uint dropped[DROPS];
};
#endif
// Dispatch parameters.
uniform uint phases;  // PHASE_ bits; mode newton: the iteration
uniform uint step_number;
#include "finite.glsl"

#ifndef WITHOUT_CHECK
// Records a vertex that is not finite. The test is cheap, since its values are in registers anyway.
void note_unless_finite(uint i, vec3 position, vec3 velocity) {
  if (!is_finite(position) || !is_finite(velocity)) {
    if (atomicMin(bad_step, step_number) >= step_number) atomicMin(bad_vertex, i);
  }
}
#endif
#endif
