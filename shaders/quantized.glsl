// Quantized positions in buffers.
#include "quantize.glsl"
// Read from one buffer and written to another (or the same, where nobody reads in the dispatch that writes).
layout(std430) restrict readonly buffer Quantized { ivec4 quantized[]; };
layout(std430) restrict writeonly buffer QuantizedOut { ivec4 quantized_out[]; };
