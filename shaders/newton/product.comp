// A z, row by row, and the dot products with r and z. LANES invocations per vertex; the last work-group that is done adds all dot products
// up, in the order of the rows.
#define SUMS_ARE coherent
#include "newton/newton.glsl"
shared vec3 parts[GROUP_SIZE];
shared bool last;
void add_up() {
  uint lane = gl_LocalInvocationIndex;
  memoryBarrierBuffer();
  vec2 dots = vec2(0.0);
  for (uint k = lane; k < PRODUCT_GROUPS; k += GROUP_SIZE) dots += vec2(sums[2u * k], sums[2u * k + 1u]);
  dots = group_sum(dots);
  if (lane == 0u) {
    sums[DOTS_AT] = dots.x;
    sums[DOTS_AT + 1u] = dots.y;
    products_done = 0u;
  }
}

void main() {
  uint lane = gl_LocalInvocationIndex, i = group_index() * (GROUP_SIZE / LANES) + lane / LANES;
  vec3 sum = vec3(0.0), own = vec3(0.0);
  if (i < VERTICES) {
    own = at(SEARCH, i).xyz;
    uint end = mesh[ROWS_AT + i + 1u];
    for (uint k = mesh[ROWS_AT + i] + lane % LANES; k < end; k += LANES) {
      uint edge = mesh[NEIGHBOURS_AT + 2u * k];
      vec3 c0 = blocks[3u * (edge >> 1)].xyz, c1 = blocks[3u * (edge >> 1) + 1u].xyz, c2 = blocks[3u * (edge >> 1) + 2u].xyz;
      vec3 d = at(SEARCH, mesh[NEIGHBOURS_AT + 2u * k + 1u]).xyz - own;
      sum += (edge & 1u) == 0u ? c0 * d.x + c1 * d.y + c2 * d.z : vec3(dot(c0, d), dot(c1, d), dot(c2, d));
    }
  }
  parts[lane] = sum;
  barrier();
  vec2 dots = vec2(0.0);
  if (lane % LANES == 0u && i < VERTICES) {
    for (uint k = 1u; k < LANES; ++k) sum += parts[lane + k];
    float inertia = at(AIM, i).w, slides = at(INVERSE, i).w;
    sum += inertia * own;
    if (slides > 0.0) sum += slides * free_part(own, floatBitsToUint(at(INVERSE2, i).w), i);
    if (!(inertia > 0.0)) sum = vec3(0.0);
    put(PRODUCT, i, sum, 0.0);
    dots = vec2(dot(at(RESIDUAL, i).xyz, own), dot(sum, own));
  }
  dots = group_sum(dots);
  if (lane == 0u) {
    if (group_index() < PRODUCT_GROUPS) {
      sums[2u * group_index()] = dots.x;
      sums[2u * group_index() + 1u] = dots.y;
    }
    memoryBarrierBuffer();
    last = atomicAdd(products_done, 1u) + 1u == gl_NumWorkGroups.x * gl_NumWorkGroups.y;
  }
  barrier();
  if (last) add_up();
}
