// The first pass of a product A z with smoothed tets: how stress and pressure of each average change. LANES invocations
// per vertex.
#define BLOCKS_ARE
#define WITHOUT_VELOCITIES
#include "solvers/newton/newton.glsl"
#include "solvers/newton/smoothing.glsl"
shared vec4 parts[3][GROUP_SIZE];

void main() {
  uint lane = gl_LocalInvocationIndex, i = group_index() * (GROUP_SIZE / LANES) + lane / LANES;
  bool exists = i < VERTICES;
  Ring ring = ring_of(exists ? i : 0u);
  mat3 change = mat3(0.0);
  float pressure = 0.0;
  if (exists && ring.inverse_volume > 0.0) {
    vec3 own = at(SEARCH, i).xyz;
    uint first = first_neighbour[i], end = first_neighbour[i + 1u];
    for (uint k = first + lane % LANES; k < end; k += LANES) {
      RingNeighbour n = ring_neighbour(ring.first_neighbour + 2u * (k - first));
      vec3 side = at(SEARCH, n.vertex).xyz - own;
      change += outerProduct(side, n.own);
      pressure += dot(slopes[neighbours[k].x].xyz, side);
    }
  }
  for (int c = 0; c < 3; ++c) parts[c][lane] = vec4(change[c], pressure);
  barrier();
  if (!exists || lane % LANES != 0u || !(ring.inverse_volume > 0.0)) return;
  for (uint k = 1u; k < LANES; ++k) {
    for (int c = 0; c < 3; ++c) change[c] += parts[c][lane + k].xyz;
    pressure += parts[0][lane + k].w;
  }
  mat3 F = MATRIX_OF(averages, i);
  mat3 stress = shear_change(F, change * ring.inverse_volume, averages[3u * i + 1u].w) * ring.shear;
  pressure *= ring.inverse_volume / ring.bulk;
  for (int c = 0; c < 3; ++c) stresses[3u * i + uint(c)] = vec4(stress[c], pressure);
}
