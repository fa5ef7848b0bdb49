// A value of each vertex alone. SPEED: of its velocity, m/s. Otherwise its distance from where `answers` has it, as a
// part of 1 / `scale`.
#include "layout.glsl"
#include "render/layout.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
#ifdef SPEED
layout(std430) readonly buffer Velocities { Velocity velocities[]; };
#else
layout(std430) readonly buffer Answers { Position answers[]; };
#endif
layout(std430) writeonly buffer Values { float values[]; };
uniform uint count;
uniform float scale;

void main() {
  uint v = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (v >= count) return;
#ifdef SPEED
  values[v] = length(velocities[v].high);
#else
  // High parts first: what two floats of like size leave is exact.
  values[v] = scale * length((positions[v].high - answers[v].high) + (positions[v].low - answers[v].low));
#endif
}
