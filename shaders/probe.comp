// What a GPU asks for at least: a dispatch that does next to nothing ($COPY 0), and bytes read and written (1). Used by
// bench.
layout(local_size_x = 256) in;
layout(std430) restrict readonly buffer From { uvec4 from[]; };
layout(std430) restrict writeonly buffer To { uvec4 to[]; };
void main() {
  uint i = gl_WorkGroupID.y * gl_NumWorkGroups.x * 256u + gl_GlobalInvocationID.x;
#if $COPY
  // Eight each, a row of all invocations apart: so many loads under way that memory, not waiting for it, is what is
  // timed.
  uint row = gl_NumWorkGroups.x * gl_NumWorkGroups.y * 256u;
  uvec4 words[8];
  for (uint k = 0u; k < 8u; ++k) words[k] = from[i + k * row];
  for (uint k = 0u; k < 8u; ++k) to[i + k * row] = words[k];
#else
  if (i == 0u) to[0] = from[0];
#endif
}
