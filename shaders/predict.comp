// Predict (method.md eqs. 1-2): v += h g, p = x + h v. One thread a vertex.
#include "types.glsl"
#include "pair.glsl"
layout(local_size_x = 256) in;
layout(std430, binding = BIND_POSITIONS) buffer Positions { Position positions[]; };
layout(std430, binding = BIND_PREDICTED) writeonly buffer Predicted { Position predicted[]; };
layout(std430, binding = BIND_VELOCITIES) buffer Velocities { Velocity velocities[]; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= params.vertex_count) return;
  Position p = positions[i];
  if (p.inverse_mass > 0.0) {
    Pair v = pair_add(Pair(velocities[i].high, velocities[i].low), params.gravity * params.h);
    v.high *= params.keep;
    v.low *= params.keep;
    precise vec3 move = params.h * v.high;
    Pair x = pair_add(Pair(p.high, p.low), move);
    x = pair_add(x, params.h * v.low);
    p.high = x.high;
    p.low = x.low;
    velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
    positions[i] = p;
  }
  predicted[i] = p;
}
