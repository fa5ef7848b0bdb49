#include "types.glsl"
#include "double_single.glsl"
#include "measure/layout.glsl"
layout(local_size_x = METRICS_SIZE) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) buffer Partials { float partials[]; };  // [quantity][group]
layout(std430) buffer Row { float row[]; };
uniform uint groups;                // of the kernels that write partials
uniform uvec2 vertex_range, edge_range, hinge_range, tet_range;  // of the body: first and end
uniform float mass;      // kg, of the body
uniform float touching;  // m, how near to an obstacle counts as contact
shared float scratch[METRICS_SIZE];

// A tree over the work-group; the result is in scratch[0] for every invocation until the next call.
float reduce(float value, bool largest) {
  uint me = gl_LocalInvocationIndex;
  barrier();
  scratch[me] = value;
  barrier();
  for (uint half_size = METRICS_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (me < half_size)
      scratch[me] = largest ? max(scratch[me], scratch[me + half_size]) : scratch[me] + scratch[me + half_size];
    barrier();
  }
  return scratch[0];
}

void store_partial(int quantity, float value, bool largest) {
  float total = reduce(value, largest);
  if (gl_LocalInvocationIndex == 0u) partials[uint(quantity) * METRICS_GROUPS + gl_WorkGroupID.x] = total;
}

// Largest quantities are maxima, all others sums.
bool is_maximum(int quantity) {
  return quantity == M_TET_MAX || quantity == M_STRETCH_MAX || quantity == M_PENETRATION;
}

// Sums the groups' partials of one quantity, in order.
float total_of(int quantity) {
  uint base = uint(quantity) * METRICS_GROUPS;
  float total = partials[base];
  for (uint g = 1u; g < groups; ++g)
    total = is_maximum(quantity) ? max(total, partials[base + g]) : total + partials[base + g];
  return total;
}
