// For the kernels of mode newton that need averages of smoothed tets.
#define Ids uint
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/smoothed.glsl"
#include "rings.glsl"
