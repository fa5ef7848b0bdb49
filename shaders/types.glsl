// Before anything else in a kernel: what GLSL calls the types that the shared texts use, and the shared layouts.
#define real float
const float rounding = 1.1920929e-7;  // 2^-23
#include "layout.glsl"
layout(std140, binding = 0) uniform StepBlock { Step params; };
