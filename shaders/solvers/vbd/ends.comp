// The begin and the end of a substep of mode vbd (method.md, "Vertex by vertex"). One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/corrections.glsl"
// The part of what pulled a vertex in the last substep by which it gained speed, 0 to 1: that of what bears a weight
// is 0, and in free fall it is 1.
layout(std430) restrict buffer Yielded { float yielded[]; };

// Sweeps begin where inertia takes the vertex with that part of what pulls it (method.md eq. 68).
void place_start(uint i, Position own) {
  Position predicted = positions[i];
  float rest = (yielded[i] - 1.0) * params.h * params.h * params.velocity_scale;
  DoubleSingle x = add_double(DoubleSingle(predicted.high, predicted.low), rest * pull_on(i));
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
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
  Velocity before = velocities[i];
  advance(i, own, before, vec3(0.0));
  if (own.inverse_mass <= 0.0) return;
  if ((phases & PHASE_PREDICT) != 0u) place_start(i, own);
  else note_yielded(i, before);
}
