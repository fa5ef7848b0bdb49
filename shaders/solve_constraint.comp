// Constraint-centric Jacobi (paper algorithm 3; method.md eqs. 4, 14), every kind present in one dispatch. A work-group solves a patch of
// constraints, each of which is in one patch, and adds the patch's sums to the vertices' with global atomics.
#include "types.glsl"
#include "pair.glsl"
#include "places.glsl"
layout(local_size_x = $GROUP) in;
layout(std430, binding = BIND_DELTAS) buffer Deltas { int deltas[]; };
#include "patch.glsl"

void main() {
  bool some = group_index() < $PATCHESu;
  uint part = some ? group_index() : 0u;
  clear_sums();
  solve_part(part, some);
  uint count = some ? parts[$PART_WORDSu * part] : 0u;
  for (uint k = gl_LocalInvocationIndex; k < count; k += $GROUPu)
    for (uint a = 0u; a < 3u; ++a)
      if (sums[3u * k + a] != 0) atomicAdd(deltas[4u * names[k] + a], sums[3u * k + a]);
}
