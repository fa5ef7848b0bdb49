// Constraint-centric Jacobi (paper algorithm 3; method.md eqs. 6, 15), every kind present in one dispatch. A work-group
// solves a patch of constraints, each of which is in one patch, and adds the patch's sums to those of the vertices with
// global atomics.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
uniform uint phases;
layout(std430) buffer Sums { int correction_sums[]; };
#include "solvers/multipliers.glsl"
#include "solvers/patch.glsl"

void main() {
  bool exists = group_index() < PATCH_COUNT;
  Chunk chunk = chunk_at(exists ? group_index() : 0u);
  sum_corrections(chunk, exists);
  uint count = exists ? chunk.vertices : 0u;
  for (uint k = gl_LocalInvocationIndex; k < count; k += GROUP_SIZE)
    for (uint a = 0u; a < 3u; ++a)
      if (sums[3u * k + a] != 0) atomicAdd(correction_sums[4u * global_ids[k] + a], sums[3u * k + a]);
}
