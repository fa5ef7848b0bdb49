// The averages of smoothed tets (method.md, "Smoothed tets"): J of every vertex, and the stress by which its F resists
// shear. AVERAGE_LANES invocations per vertex, whose sums are added in a fixed order.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
layout(std430) restrict writeonly buffer Averages { vec4 averages[]; };  // of each vertex three columns in Pa; J
#define Ids uint
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/smoothed.glsl"
#include "averages.glsl"
shared vec4 parts[3][GROUP_SIZE];
ivec4 origin;
vec3 ring_side(uint j) { return between(quantized[j], origin); }

void main() {
  uint lane = gl_LocalInvocationIndex, i = group_index() * (GROUP_SIZE / AVERAGE_LANES) + lane / AVERAGE_LANES;
  bool exists = i < params.vertex_count;
  Ring ring = ring_of(exists ? i : 0u);
  mat3 F = mat3(0.0);
  float J = 0.0;
  if (exists && ring.inverse_volume > 0.0) {
    begin_body(i);
    origin = quantized[i];
    add_averages(ring, lane % AVERAGE_LANES, AVERAGE_LANES, F, J);
  }
  for (int c = 0; c < 3; ++c) parts[c][lane] = vec4(F[c], J);
  for (uint half_size = AVERAGE_LANES / 2u; half_size > 0u; half_size /= 2u) {
    barrier();
    if (lane % AVERAGE_LANES < half_size)
      for (int c = 0; c < 3; ++c) parts[c][lane] += parts[c][lane + half_size];
  }
  if (!exists || lane % AVERAGE_LANES != 0u || !(ring.inverse_volume > 0.0)) return;
  for (int c = 0; c < 3; ++c) F[c] = parts[c][lane].xyz * ring.inverse_volume;
  mat3 stress = shear_stress(F) * ring.shear;
  for (int c = 0; c < 3; ++c) averages[3u * i + uint(c)] = vec4(stress[c], parts[0][lane].w * ring.inverse_volume);
}
