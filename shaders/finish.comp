// Finish (method.md eq. 5): v += (p - predicted) / h, the corrections and nothing else. One thread a vertex.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = 256) in;
layout(std430, binding = BIND_POSITIONS) readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_PREDICTED) readonly buffer Predicted { Position predicted[]; };
layout(std430, binding = BIND_VELOCITIES) buffer Velocities { Velocity velocities[]; };

#include "first_bad.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= params.vertex_count) return;
  Position p = positions[i];
  if (!(p.inverse_mass > 0.0)) {
    note_unless_finite(i, p.high + p.low, vec3(0.0));
    return;
  }
  Pair v = pair_add(Pair(velocities[i].high, velocities[i].low), relative(p, predicted[i]) * params.inverse_h);
  velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
  note_unless_finite(i, p.high + p.low, v.high + v.low);
}
