// Comes first in a kernel: the number type of formulas shared with C++, and the shared layouts.
#define real float
const float rounding = 1.1920929e-7;  // 2^-23
#define quantization_size params.quantized_size
#include "layout.glsl"
layout(std140, binding = BIND_STEP) uniform StepBlock { Step params; };
// Work-groups are in rows where there are more than a dispatch may have in one dimension.
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
