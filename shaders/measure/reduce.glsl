#include "types.glsl"
#include "double_single.glsl"
#include "measure/layout.glsl"
layout(local_size_x = METRICS_SIZE) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) buffer Partials { float partials[]; };  // [quantity][group]
layout(std430) buffer Row { float row[]; };
uniform uint groups;  // work-groups of the kernels that write partials
uniform uvec2 vertex_range, edge_range, hinge_range, tet_range;  // of the body: first and end
uniform float mass;      // kg, of the body
uniform float touching;  // m, the distance to an obstacle that counts as contact
shared float scratch[METRICS_SIZE];

// Quantities are sums or maxima over vertices or constraints.
float combine(int quantity, float a, float b) {
  return quantity == M_TET_MAX || quantity == M_STRETCH_MAX || quantity == M_PENETRATION ? max(a, b) : a + b;
}

// Reduces the work-group's values by a tree. The first barrier is for the readers of the quantity before.
void store_partial(int quantity, float value) {
  uint me = gl_LocalInvocationIndex;
  barrier();
  scratch[me] = value;
  barrier();
  for (uint half_size = METRICS_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (me < half_size) scratch[me] = combine(quantity, scratch[me], scratch[me + half_size]);
    barrier();
  }
  if (me == 0u) partials[uint(quantity) * METRICS_GROUPS + gl_WorkGroupID.x] = scratch[0];
}

// Combines the groups' partials of one quantity, in order.
float total(int quantity) {
  uint base = uint(quantity) * METRICS_GROUPS;
  float result = partials[base];
  for (uint g = 1u; g < groups; ++g) result = combine(quantity, result, partials[base + g]);
  return result;
}
