// The vertices in mode gauss-seidel: prediction before the colours, contacts behind them, and at last the new velocity
// (method.md eqs. 1-2, 4, 13, 48-49). One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/corrections.glsl"

void settle(uint i) {
  begin_body(i);
  Position own = positions[i];
  Velocity speed;
  if ((phases & (PHASE_PREDICT | PHASE_FINISH)) != 0u) speed = velocities[i];
  vec3 correction = vec3(0.0);
  if ((phases & PHASE_SOLVE) != 0u && own.inverse_mass > 0.0) {
    // Constraints have moved the vertex already. Contacts, and records of hard bodies, ask by how much in all.
    Velocity predicted = PREDICTED(i);
    correction = relative(DoubleSingle(own.high, own.low), DoubleSingle(predicted.high, predicted.low));
    own = Position(predicted.high, own.inverse_mass, predicted.low, own.constraints);
  }
  advance(i, own, speed, correction);
}

void main() {
  uint i = group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
#if RIGID_CONTACT
  begin_sums(i - gl_LocalInvocationIndex);
  barrier();
#endif
  if (i < params.vertex_count) settle(i);
#if RIGID_CONTACT
  if ((phases & PHASE_FINISH) != 0u) end_sums();
#endif
}
