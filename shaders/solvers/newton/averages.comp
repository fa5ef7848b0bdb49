// Averages of F and J at Newton's start. LANES invocations per vertex.
#define BLOCKS_ARE
#define WITHOUT_VELOCITIES
#include "solvers/newton/newton.glsl"
#include "solvers/newton/smoothing.glsl"
#include "averages.glsl"
shared vec4 parts[3][GROUP_SIZE];
ivec4 origin;
uint start;
vec3 ring_side(uint j) { return between(start_at(start, j), origin); }

void main() {
  uint lane = gl_LocalInvocationIndex, i = group_index() * (GROUP_SIZE / LANES) + lane / LANES;
  bool exists = i < VERTICES;
  Ring ring = ring_of(exists ? i : 0u);
  mat3 F = mat3(0.0);
  float J = 0.0;
  if (exists && ring.inverse_volume > 0.0) {
    begin_body(i);
    start = chosen_start(body_of(i));
    origin = start_at(start, i);
    add_averages(ring, lane % LANES, LANES, F, J);
  }
  for (int c = 0; c < 3; ++c) parts[c][lane] = vec4(F[c], J);
  barrier();
  if (!exists || lane % LANES != 0u || !(ring.inverse_volume > 0.0)) return;
  for (uint k = 1u; k < LANES; ++k) {
    for (int c = 0; c < 3; ++c) F[c] += parts[c][lane + k].xyz;
    J += parts[0][lane + k].w;
  }
  F *= ring.inverse_volume;
  vec3 last = vec3(J * ring.inverse_volume, shear_hold(F), 0.0);
  for (int c = 0; c < 3; ++c) averages[3u * i + uint(c)] = vec4(F[c], last[c]);
}
