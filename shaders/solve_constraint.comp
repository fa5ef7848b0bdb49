// Constraint-centric Jacobi (paper algorithm 3; method.md eqs. 4, 14), every kind present in one dispatch. A work-group solves a patch:
// neighbouring constraints of all kinds. It reads the places of the patch's vertices once, adds up corrections in shared memory, one
// thread a constraint, and adds the patch's sums to the vertices' with global atomics. Sums are integers, so their order does
// not matter and the result is the same bits every time, however constraints are cut into patches. A unit is params.delta_unit times
// the vertex's number of constraints, and no correction exceeds params.limit = 2^30 units over that number: no sum can overflow.
#include "types.glsl"
#include "pair.glsl"
#include "places.glsl"
layout(local_size_x = $GROUP) in;
layout(std430, binding = BIND_DELTAS) buffer Deltas { int deltas[]; };
// For each patch where its vertices and its records of each kind begin and where the records end; last, where the vertices end.
layout(std430, binding = BIND_PATCHES) restrict readonly buffer Patches { uint patches[]; };
layout(std430, binding = BIND_PATCH_VERTICES) restrict readonly buffer PatchVertices { uvec2 vertices[]; };  // vertex, n_i as float bits
layout(std430, binding = BIND_PATCH_RECORDS) restrict readonly buffer Records { uvec2 records[]; };  // a byte for each vertex of the patch, rest
uniform uint patch_count;

#define MOST 256u  // vertices of a patch
shared ivec4 here[MOST];
shared uint names[MOST];
shared float units_per_metre[MOST];
shared int sums[3u * MOST];
#include "constraints/types.glsl"
#include "guards.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "patch.glsl"

void main() {
  uint group = group_index(), me = gl_LocalInvocationIndex;
  uint row = min(group, patch_count - 1u) * ($KINDSu + 2u);
  uint first = patches[row], count = group < patch_count ? patches[row + $KINDSu + 2u] - first : 0u;
  for (uint k = me; k < count; k += $GROUPu) {
    uvec2 vertex = vertices[first + k];
    names[k] = vertex.x;
    here[k] = places[vertex.x];
    units_per_metre[k] = 1.0 / (params.delta_unit * uintBitsToFloat(vertex.y));
    sums[3u * k] = sums[3u * k + 1u] = sums[3u * k + 2u] = 0;
  }
  barrier();
  if (group < patch_count) {
    #foreach solve_$KIND(patches[row + 1u + $INDEXu] + me, patches[row + 2u + $INDEXu]);
  }
  barrier();
  for (uint k = me; k < count; k += $GROUPu) {
    uint vertex = vertices[first + k].x;
    for (uint a = 0u; a < 3u; ++a)
      if (sums[3u * k + a] != 0) atomicAdd(deltas[4u * vertex + a], sums[3u * k + a]);
  }
}
