// After a step: the shapes at rest of tets that yield, and their copies in what the solver reads.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = 128) in;
#include "yield.glsl"
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) buffer YieldRecords { YieldRecord tets[]; };
layout(std430) restrict readonly buffer YieldCopies { uint copies[]; };
layout(std430) restrict writeonly buffer RestValues { float rest_values[]; };  // the solver's buffer
uniform uint count, flows;  // flows 0: copies alone
uniform float dt;           // s, of the step
void main() {
  uint k = group_index() * 128u + gl_LocalInvocationIndex;
  if (k >= count) return;
  float creep_time = tets[k].creep_time;
  vec3 x[4];
  float metric[6];
  uint first = tets[k].vertices[0];
  for (int j = 0; j < 4; ++j) x[j] = relative(positions[tets[k].vertices[j]], positions[first]);
  for (int m = 0; m < 6; ++m) metric[m] = tets[k].metric[m];
  if (flows != 0u) {
    float kept = creep_time > 0.0 ? exp(-dt / creep_time) : 0.0;
    metric = yielded(x, metric, 6.0 * tets[k].rest, tets[k].yield_strain, kept).values;
    for (int m = 0; m < 6; ++m) tets[k].metric[m] = metric[m];
  }
  for (uint c = tets[k].first_copy; c < tets[k].end_copy; ++c)
    for (uint m = 0u; m < 6u; ++m) rest_values[copies[c] + m] = metric[m];
}
