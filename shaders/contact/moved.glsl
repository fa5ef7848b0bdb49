// Writes a vertex that contact moved after the solver did, and what neighbours see of it.
#if QUANTIZED
#include "quantize.glsl"
#include "seen.glsl"
layout(std430) restrict writeonly buffer QuantizedOut { ivec4 quantized_out[]; };
#endif
void write_moved(uint i, Position own, DoubleSingle x, DoubleSingle v, float work) {
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v.high, work, v.low, 0.0);
#if QUANTIZED
  begin_body(i);
#if COMPLIANT
  DoubleSingle before = own.inverse_mass > 0.0 ? place_before(x, v) : x;
  if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(before, 0.0);
#endif
  quantized_out[i] = quantize(own.inverse_mass > 0.0 ? seen_by_neighbours(i, x, v) : x, weight_of(own));
#endif
}
