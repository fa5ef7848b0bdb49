// A z, row by row, and its dot products with r and z. LANES invocations per vertex; the last work-group to end adds all
// dot products up, in the order of the rows.
#define COLUMNS 1
#include "solvers/newton/newton.glsl"
shared vec3 parts[GROUP_SIZE];
shared bool last;
void add_up() {
  uint lane = gl_LocalInvocationIndex;
  memoryBarrierBuffer();
  vec2 sum = vec2(0.0);
  for (uint k = lane; k < PRODUCT_GROUPS; k += GROUP_SIZE) sum += group_dots[k];
  columns[0][lane] = vec4(sum, 0.0, 0.0);
  add_up_columns();
  if (lane == 0u) {
    dots = columns[0][0].xy;
    products_done = 0u;
  }
}

void main() {
  uint lane = gl_LocalInvocationIndex, i = group_index() * (GROUP_SIZE / LANES) + lane / LANES;
  vec3 sum = vec3(0.0), own = vec3(0.0);
  if (i < VERTICES) {
    own = at(SEARCH, i).xyz;
    uint end = first_neighbour[i + 1u];
    for (uint k = first_neighbour[i] + lane % LANES; k < end; k += LANES) {
      uint edge = neighbours[k].x, e = edge >> 1;
      vec3 c0 = blocks[e].columns[0].xyz, c1 = blocks[e].columns[1].xyz, c2 = blocks[e].columns[2].xyz;
      vec3 d = at(SEARCH, neighbours[k].y).xyz - own;
      sum += (edge & 1u) == 0u ? c0 * d.x + c1 * d.y + c2 * d.z : vec3(dot(c0, d), dot(c1, d), dot(c2, d));
    }
  }
  parts[lane] = sum;
  barrier();
  vec2 own_dots = vec2(0.0);
  if (lane % LANES == 0u && i < VERTICES) {
    for (uint k = 1u; k < LANES; ++k) sum += parts[lane + k];
    float inertia = at(AIM, i).w, slides = at(INVERSE, i).w;
    sum += inertia * own;
    if (slides > 0.0) sum += slides * free_part(own, floatBitsToUint(at(INVERSE2, i).w), i);
    if (!(inertia > 0.0)) sum = vec3(0.0);
    put(PRODUCT, i, sum, 0.0);
    own_dots = vec2(dot(at(RESIDUAL, i).xyz, own), dot(sum, own));
  }
  columns[0][lane] = vec4(own_dots, 0.0, 0.0);
  add_up_columns();
  if (lane == 0u) {
    if (group_index() < PRODUCT_GROUPS) group_dots[group_index()] = columns[0][0].xy;
    memoryBarrierBuffer();
    last = atomicAdd(products_done, 1u) + 1u == gl_NumWorkGroups.x * gl_NumWorkGroups.y;
  }
  barrier();
  if (last) add_up();
}
