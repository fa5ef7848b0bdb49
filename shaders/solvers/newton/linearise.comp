// A block of the Hessian and a force for every edge of the matrix (method.md eq. 36), added up over all constraints
// that both vertices have. The gradients of a constraint add up to zero, and so do the blocks of a row: forces and
// diagonal blocks are sums over edges. One invocation per edge.
#if AVERAGED
#define BLOCKS_ARE
#else
#define BLOCKS_ARE writeonly
#endif
#include "solvers/newton/newton.glsl"
vec3 slope_of_first = vec3(0.0), slope_of_second = vec3(0.0);
#define Ids uvec4  // of the vertices
uint id_of(Ids ids, int j) { return ids[j]; }
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "solvers/newton/rest.glsl"
#foreach #include "solvers/newton/element.glsl"

void main() {
  uint edge = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (edge >= EDGES) return;
  uint start = chosen_start(0u), end = first_use[edge + 1u];
  mat3 block = mat3(0.0);
  vec3 force = vec3(0.0);
  for (uint k = first_use[edge]; k < end; ++k) {
    uint use = uses[k], kind = USE_KIND(use), c = USE_CONSTRAINT(use);
    int i = USE_I(use), j = USE_J(use);
    #foreach if (kind == $INDEXu) add_$KIND(c, start, i, j, block, force);
  }
#if AVERAGED
  slopes[2u * edge] = vec4(slope_of_first, 0.0);
  slopes[2u * edge + 1u] = vec4(slope_of_second, 0.0);
#endif
  for (int c = 0; c < 3; ++c) blocks[edge].columns[c] = vec4(block[c], force[c]);
}
