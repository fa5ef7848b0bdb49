// Copies part of the state, with `good_only` unless a vertex was not finite, which the GPU decides without a wait. The
// dispatch takes some microseconds; NVIDIA's driver takes 0.1 to 0.5 ms to switch to glCopyBufferSubData and back.
#include "layout.glsl"
layout(local_size_x = 256) in;
layout(std430) readonly buffer From { uint from[]; };
layout(std430) writeonly buffer To { uint to[]; };
layout(std430) readonly buffer Check { uint bad_step, bad_vertex; };
uniform uint count, from_at, to_at, good_only;

void main() {
  // With strides, a large state needs no more work-groups than any driver allows.
  for (uint i = gl_GlobalInvocationID.x; i < count && (bad_step == ~0u || good_only == 0u);
       i += gl_NumWorkGroups.x * 256u)
    to[to_at + i] = from[from_at + i];
}
