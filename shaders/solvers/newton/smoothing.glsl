// For the kernels of mode newton that need averages of smoothed tets.
#define Ids uint
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/smoothed.glsl"
#include "rings.glsl"
mat3 average_F(uint i) { return mat3(averages[3u * i].xyz, averages[3u * i + 1u].xyz, averages[3u * i + 2u].xyz); }
