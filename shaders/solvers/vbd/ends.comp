// The begin and the end of a substep of mode vbd, and what follows a sweep (method.md, "Vertex Block Descent"). One
// invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/corrections.glsl"
// The part of what pulled a vertex in the last substep by which it gained speed, 0 to 1: that of what bears a weight
// is 0, and in free fall it is 1.
layout(std430) restrict buffer Yielded { float yielded[]; };

#if ACCELERATED
// Where the last two sweeps left each vertex, from where inertia takes it: those of even number, then those of odd.
layout(std430) restrict buffer Sweeps { vec4 sweeps[]; };
uniform uint sweep;        // from 1 on; 0 is the start
uniform float chebyshev;   // omega of method.md eq. 43
// A vertex that may touch an obstacle stays where the sweep left it, since contact was resolved there.
void accelerate(uint i, Position own) {
  begin_body(i);
  uint last_but_one = (sweep & 1u) * params.vertex_count + i;
  DoubleSingle x = DoubleSingle(own.high, own.low);
  vec3 from = relative(x, DoubleSingle(PREDICTED(i).high, PREDICTED(i).low));
  vec3 further = (chebyshev - 1.0) * (from - sweeps[last_but_one].xyz);
  DoubleSingle there = add_double(x, further);
  if (may_touch(there)) there = x, further = vec3(0.0);
  sweeps[last_but_one] = vec4(from + further, 0.0);
  positions[i] = Position(there.high, own.inverse_mass, there.low, own.constraints);
}
#endif

// Sweeps begin where inertia takes the vertex with that part of what pulls it (method.md eq. 42).
void place_start(uint i, Position own) {
  Position predicted = positions[i];
  float rest = (yielded[i] - 1.0) * params.h * params.h * params.velocity_scale;
  DoubleSingle x = add_double(DoubleSingle(predicted.high, predicted.low), rest * pull_on(i));
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
#if ACCELERATED
  sweeps[i] = vec4(relative(x, DoubleSingle(PREDICTED(i).high, PREDICTED(i).low)), 0.0);
#endif
}
void note_yielded(uint i, Velocity before) {
  vec3 pull = pull_on(i);
  vec3 gain = (velocities[i].high - before.high) + (velocities[i].low - before.low) + params.h * pull;
  float whole = params.h * dot(pull, pull);
  yielded[i] = whole > 0.0 ? clamp(dot(gain, pull) / whole, 0.0, 1.0) : 1.0;
}

void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i >= params.vertex_count) return;
  if (phases == 0u) {  // after a change from outside
    yielded[i] = 1.0;
    return;
  }
  Position own = positions[i];
#if ACCELERATED
  if (phases == PHASE_SOLVE) {
    if (own.inverse_mass > 0.0) accelerate(i, own);
    return;
  }
#endif
  Velocity before = velocities[i];
  advance(i, own, before, vec3(0.0));
  if (own.inverse_mass <= 0.0) return;
  if ((phases & PHASE_PREDICT) != 0u) place_start(i, own);
  else note_yielded(i, before);
}
