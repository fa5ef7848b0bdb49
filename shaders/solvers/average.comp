// The second half of constraint-centric Jacobi (method.md eqs. 13, 15): p += omega * (sum of corrections) / n_i, then
// contacts. It also clears the sums. One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
layout(std430) buffer Sums { ivec4 correction_sums[]; };
#include "solvers/corrections.glsl"

void average(uint i) {
  begin_body(i);
  Position own = positions[i];
  Velocity speed;
  if ((phases & (PHASE_PREDICT | PHASE_FINISH)) != 0u) speed = velocities[i];
  vec3 correction = vec3(0.0);
  if ((phases & PHASE_SOLVE) != 0u) {
    ivec4 sum = correction_sums[i];
    correction_sums[i] = ivec4(0);
#if FLOAT_SUMS
    if (own.constraints > 0.0) correction = intBitsToFloat(sum).xyz * (params.omega / own.constraints);
#else
    correction = vec3(sum.xyz) * (FINE(params.correction_quantum) * params.omega);
#endif
  }
  advance(i, own, speed, correction);
}

void main() {
  uint i = group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
#if RIGID_CONTACT
  begin_sums(i - gl_LocalInvocationIndex);
  barrier();
#endif
  if (i < params.vertex_count) average(i);
#if RIGID_CONTACT
  if ((phases & PHASE_FINISH) != 0u) end_sums();
#endif
}
