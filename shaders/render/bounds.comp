// Bounds of all finite positions: least x, y, z and greatest x, y, z. Floats as integers of the same order, since
// minimum and maximum of integers are atomic and do not depend on the order of threads.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
layout(local_size_x = 128) in;
layout(std430, binding = BIND_RENDER_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_RENDER_BOUNDS) buffer Bounds { uint bounds[6]; };
uniform uint count;

shared uint low[3], high[3];

uint ordered(float x) {
  uint bits = floatBitsToUint(x);
  return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

void main() {
  uint i = gl_GlobalInvocationID.x, lane = gl_LocalInvocationIndex;
  if (lane < 3u) {
    low[lane] = 0xffffffffu;
    high[lane] = 0u;
  }
  barrier();
  if (i < count) {
    vec3 p = positions[i].high;
    if (finite(p))
      for (int axis = 0; axis < 3; ++axis) {
        atomicMin(low[axis], ordered(p[axis]));
        atomicMax(high[axis], ordered(p[axis]));
      }
  }
  barrier();
  if (lane < 3u) {
    atomicMin(bounds[lane], low[lane]);
    atomicMax(bounds[3u + lane], high[lane]);
  }
}
