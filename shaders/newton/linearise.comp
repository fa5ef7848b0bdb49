// A block of the Hessian and a force for every edge of the matrix (method.md eq. 41): what all constraints of both vertices add. The
// gradients of a constraint sum up to nothing, and so do the blocks of a row: force and diagonal are sums over edges. One invocation per
// edge.
#define BLOCKS_ARE writeonly
#include "newton/newton.glsl"
#define Ids uint  // of the record
uint id_of(Ids record, int j) { return mesh[record + uint(j)]; }
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"
#include "newton/records.glsl"
#foreach #include "newton/element_$COMPONENTS.glsl"

void main() {
  uint edge = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (edge >= EDGES) return;
  uint part = start_part(), end = mesh[EDGES_AT + edge + 1u];
  mat3 block = mat3(0.0);
  vec3 force = vec3(0.0);
  for (uint k = mesh[EDGES_AT + edge]; k < end; ++k) {
    uint entry = mesh[ENTRIES_AT + k], kind = (entry >> 4) & 7u, c = entry >> 7;
    int i = int((entry >> 2) & 3u), j = int(entry & 3u);
    #foreach if (kind == $INDEXu) add_$KIND(RECORDS_$KIND + WORDS_$KIND * c, part, i, j, block, force);
  }
  for (int c = 0; c < 3; ++c) blocks[3u * edge + uint(c)] = vec4(block[c], force[c]);
}
