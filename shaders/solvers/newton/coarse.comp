// The coarse unknowns y = A_c^-1 r. ROW_LANES invocations per row of the inverse.
#include "solvers/newton/newton.glsl"
shared float parts[GROUP_SIZE];
void main() {
  uint lane = gl_LocalInvocationIndex, row = group_index() * (GROUP_SIZE / ROW_LANES) + lane / ROW_LANES;
  float sum = 0.0;
  if (row < UNKNOWNS)
    for (uint k = lane % ROW_LANES; k < COARSE_ROW; k += ROW_LANES) {
      vec4 m = coarse_inverse[row * COARSE_ROW + k];
      for (uint c = 0u; c < 4u; ++c) sum += m[c] * coarse_r[4u * k + c];
    }
  parts[lane] = sum;
  barrier();
  for (uint half_size = ROW_LANES / 2u; half_size > 0u; half_size /= 2u) {
    if (lane % ROW_LANES < half_size) parts[lane] += parts[lane + half_size];
    barrier();
  }
  if (lane % ROW_LANES == 0u && row < UNKNOWNS) coarse_y[row] = is_free[row / 6u] * parts[lane];
}
