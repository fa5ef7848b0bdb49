// Before anything else in a kernel: what GLSL calls the types that the shared texts use, and the shared layouts.
#define real float
const float rounding = 1.1920929e-7;  // 2^-23
#define quantization_size params.quantized_size
#include "layout.glsl"
layout(std140, binding = BIND_STEP) uniform StepBlock { Step params; };
// Work-groups lie in rows where there are more than one dimension of a dispatch may have.
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
