// What both measuring kernels share. A kernel sets `values` of the quantities from FIRST on, REDUCED in number.
#include "types.glsl"
#include "double_single.glsl"
#include "measure/layout.glsl"
layout(local_size_x = METRICS_SIZE) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) readonly buffer Velocities { Velocity velocities[]; };
layout(std430) readonly buffer Rest { vec4 rest[]; };  // relative to the body's centre of mass, and the mass
layout(std430) coherent buffer Partials {  // read by the last work-group to end
  uint groups_done;
  float partials[];  // [quantity][group]
};
layout(std430) buffer Row { float row[]; };
uniform uint groups;         // work-groups of the dispatch
uniform uvec2 vertex_range;  // of the body: first and end
uniform float mass;          // kg, of the body
#define TREES 8
shared float trees[TREES][METRICS_SIZE];
shared bool last;
float values[REDUCED];

// Quantities are sums or maxima over vertices or constraints.
float combine(int quantity, float a, float b) {
  return quantity == M_TET_MAX || quantity == M_STRETCH_MAX || quantity == M_PENETRATION ? max(a, b) : a + b;
}

// Reduces the work-group's values, several at a time, each by a tree.
void store_partials() {
  uint me = gl_LocalInvocationIndex;
  for (int first = 0; first < REDUCED; first += TREES) {
    barrier();
    for (int k = 0; k < TREES; ++k)
      if (first + k < REDUCED) trees[k][me] = values[first + k];
    barrier();
    for (uint half_size = METRICS_SIZE / 2u; half_size > 0u; half_size /= 2u) {
      if (me < half_size)
        for (int k = 0; k < TREES; ++k)
          if (first + k < REDUCED)
            trees[k][me] = combine(FIRST + first + k, trees[k][me], trees[k][me + half_size]);
      barrier();
    }
    int quantity = first + int(me);
    if (me < TREES && quantity < REDUCED)
      partials[(FIRST + quantity) * METRICS_GROUPS + int(gl_WorkGroupID.x)] = trees[me][0];
  }
}

// Whether this work-group is the last to get here: it sees the partials of all.
bool ends_last() {
  memoryBarrierBuffer();
  barrier();
  if (gl_LocalInvocationIndex == 0u) {
    last = atomicAdd(groups_done, 1u) + 1u == groups;
    if (last) groups_done = 0u;
  }
  barrier();
  memoryBarrierBuffer();
  return last;
}

// Combines the groups' partials of one quantity, in order; several are read side by side, because each takes long to
// arrive.
float total(int quantity) {
  int base = quantity * METRICS_GROUPS;
  float result = partials[base], next[TREES];
  for (int first = 1; first < int(groups); first += TREES) {
    for (int k = 0; k < TREES; ++k) next[k] = partials[base + min(first + k, METRICS_GROUPS - 1)];
    for (int k = 0; k < TREES; ++k)
      if (first + k < int(groups)) result = combine(quantity, result, next[k]);
  }
  return result;
}
