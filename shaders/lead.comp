// Leads pinned vertices a part of the way that is left to their places (sim/led.cpp). One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = 64) in;
#define WITHOUT_CHECK
#include "vertex_state.glsl"
layout(std430) restrict buffer LedVertices { LedVertex led[]; };
#if QUANTIZED
#include "quantize.glsl"
#include "seen.glsl"
layout(std430) restrict writeonly buffer QuantizedOut { ivec4 quantized_out[]; };
#endif
#if CONTACTS
#include "contact/bodies/limit.glsl"
// One without pairs must not go where none were looked for; the others are stopped by contact/bodies/truncate.comp.
vec3 listed_way(uint i, DoubleSingle x, vec3 way) {
  vec4 listed = texelFetch(listed_places, int(i));
  bool limited = (phases & PHASE_NEAR) != 0u && floatBitsToInt(listed.w) > 0;
  return limited ? within_limit(listed, x, way) : way;
}
#else
vec3 listed_way(uint i, DoubleSingle x, vec3 way) { return way; }
#endif
uniform uint stage;  // 0: aims, so that contact knows the velocity; 1: goes; 2: stops
uniform uint count;
uniform float part;
uniform bool starts;  // the step
void main() {
  uint k = group_index() * 64u + gl_LocalInvocationIndex;
  if (k >= count) return;
  LedVertex to = led[k];
  uint i = to.vertex;
  Position own = positions[i];
  DoubleSingle x = DoubleSingle(own.high, own.low);
  vec3 way = stage == 2u ? vec3(0.0) : part * relative(DoubleSingle(to.high, to.low), x);
  float speed = length(way) * params.inverse_h;
  if (stage == 0u && starts) led[k].speed = 1.001 * speed;
  else if (speed > to.speed) way *= to.speed / speed;  // held back so far, it does not make up for that at once
  if (stage == 1u) way = listed_way(i, x, way);
  velocities[i] = Velocity(way * params.inverse_h, velocities[i].work, vec3(0.0), 0.0);
  if (stage != 1u) return;
  x = add_double(x, way);
  positions[i] = Position(x.high, 0.0, x.low, own.constraints);
#if QUANTIZED
  begin_body(i);
  quantized_out[i] = quantize(x, weight_of(positions[i]));
#endif
}
