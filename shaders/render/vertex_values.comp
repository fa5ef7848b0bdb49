// Values by vertex that need no neighbours: with SPEED the speed in m/s, otherwise `scale` times the distance from the
// position in `reference`.
#include "layout.glsl"
#include "render/layout.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
#ifdef SPEED
layout(std430) readonly buffer Velocities { Velocity velocities[]; };
#else
layout(std430) readonly buffer Reference { Position reference[]; };
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
  // High parts are subtracted first, since the difference of two floats of like size is exact.
  values[v] = scale * length((positions[v].high - reference[v].high) + (positions[v].low - reference[v].low));
#endif
}
