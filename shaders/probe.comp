// Measures for bench the least cost of a dispatch ($COPY 0), and of bytes read and written ($COPY 1).
layout(local_size_x = 256) in;
layout(std430) restrict readonly buffer From { uvec4 from[]; };
layout(std430) restrict writeonly buffer To { uvec4 to[]; };
void main() {
  uint i = gl_WorkGroupID.y * gl_NumWorkGroups.x * 256u + gl_GlobalInvocationID.x;
#if $COPY
  // Eight loads are under way in each invocation, so that bandwidth is timed, not latency.
  uint row = gl_NumWorkGroups.x * gl_NumWorkGroups.y * 256u;
  uvec4 values[8];
  for (uint k = 0u; k < 8u; ++k) values[k] = from[i + k * row];
  for (uint k = 0u; k < 8u; ++k) to[i + k * row] = values[k];
#else
  if (i == 0u) to[0] = from[0];
#endif
}
