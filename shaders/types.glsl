// Comes first in a kernel: the number type of formulas shared with C++, and the shared layouts.
#define real float
const float rounding = 1.1920929e-7;  // 2^-23
#define quantization_size FINE(params.quantized_size)
#include "layout.glsl"
layout(std140, binding = BIND_STEP) uniform StepBlock { Step params; };
float activation_of(uint fibres) { return params.activation[fibres / 4u][fibres % 4u]; }
// The block's quanta are those of the largest body. A body that is far smaller has finer ones, by a power of two: that
// of the vertex which begin_body() named.
#ifdef BODY_QUANTA
layout(binding = UNIT_QUANTA) uniform samplerBuffer vertex_quanta;
float fineness = 1.0;
float fineness_at(uint i) { return texelFetch(vertex_quanta, int(i)).r; }
void begin_body(uint i) { fineness = fineness_at(i); }
#define FINE(value) ((value) * fineness)
#define COARSE(value) ((value) / fineness)
#define FINE_AT(value, i) ((value) * fineness_at(i))
#else
#define begin_body(i)
#define FINE(value) (value)
#define COARSE(value) (value)
#define FINE_AT(value, i) (value)
#endif
// Work-groups are in rows where there are more than a dispatch may have in one dimension.
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
