// Quantized positions in buffers. With compliance, as many more follow, of the substep's start.
#include "quantize.glsl"
// These are different buffers, unless no invocation reads the positions of others in a dispatch that writes.
layout(std430) restrict readonly buffer Quantized { ivec4 quantized[]; };
layout(std430) restrict writeonly buffer QuantizedOut { ivec4 quantized_out[]; };
