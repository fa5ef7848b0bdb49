// The coarse unknowns y = A_c^-1 r, body by body. ROW_LANES invocations per row of the inverse. Where obstacles can
// stop a free body, the inverse knows how it deforms, and the response to rigid motions is added here (0 of a body that
// is held).
#include "solvers/newton/newton.glsl"
#if RIGID_START
#define PARTS_OF_ROW 7
#else
#define PARTS_OF_ROW 1
#endif
shared float parts[PARTS_OF_ROW][GROUP_SIZE];

#if RIGID_START
vec3 coarse_vector(uint at) { return vec3(coarse_r[at], coarse_r[at + 1u], coarse_r[at + 2u]); }
vec3 arm_of_aggregate(uint k, uint body) { return turned(rotations[k], centres[k].xyz - bodies[body].xyz); }
// Adds the force on aggregate k and its moment about the centre of mass of the body, which holds it.
void add_force(uint k, uint body, inout float g[6]) {
  vec3 f = turned(rotations[k], coarse_vector(6u * k)), m = turned(rotations[k], coarse_vector(6u * k + 3u));
  m = centres[k].w * m + cross(arm_of_aggregate(k, body), f);
  for (int c = 0; c < 3; ++c) g[c] += f[c], g[3 + c] += m[c];
}
// What row `row` gets of the rigid motion that force and moment `g` give its body.
float rigid_part(uint row, uint body, float g[6]) {
  uint k = row / 6u;
  vec3 arm = responses[body].arm.xyz, moved = vec3(0.0), turn = vec3(0.0);
  vec3 moment = vec3(g[3], g[4], g[5]) + cross(arm, vec3(g[0], g[1], g[2]));  // about the origin of the response
  for (int j = 0; j < 6; ++j) {
    float load = j < 3 ? g[j] : moment[j - 3];
    for (int i = 0; i < 3; ++i) {
      moved[i] += responses[body].inverse[6 * i + j] * load;
      turn[i] += responses[body].inverse[6 * (3 + i) + j] * load;
    }
  }
  moved += cross(turn, arm + arm_of_aggregate(k, body));
  vec4 back = opposite(rotations[k]);
  vec3 part = row % 6u < 3u ? turned(back, moved) : centres[k].w * turned(back, turn);
  return part[row % 3u];
}
#endif

void main() {
  uint lane = gl_LocalInvocationIndex, row = group_index() * (GROUP_SIZE / ROW_LANES) + lane / ROW_LANES;
  float sum = 0.0;
  uint body = BODIES == 1u || row >= UNKNOWNS ? 0u : aggregate_bodies[row / 6u];
  BodyRange range = range_of(body);
  if (row < UNKNOWNS) {
    uint first = 6u * range.first_aggregate, end = 6u * range.end_aggregate;
    for (uint k = lane % ROW_LANES; k < range.coarse_row; k += ROW_LANES) {
      vec4 m = coarse_inverse[range.coarse_at + (row - first) * range.coarse_row + k];
      for (uint c = 0u; c < 4u; ++c)
        if (BODIES == 1u || first + 4u * k + c < end) sum += m[c] * coarse_r[first + 4u * k + c];
    }
  }
  parts[0][lane] = sum;
#if RIGID_START
  float g[6] = float[6](0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
  for (uint k = range.first_aggregate + lane % ROW_LANES; k < range.end_aggregate; k += ROW_LANES)
    add_force(k, body, g);
  for (int c = 0; c < 6; ++c) parts[1 + c][lane] = g[c];
#endif
  barrier();
  for (uint half_size = ROW_LANES / 2u; half_size > 0u; half_size /= 2u) {
    if (lane % ROW_LANES < half_size)
      for (int c = 0; c < PARTS_OF_ROW; ++c) parts[c][lane] += parts[c][lane + half_size];
    barrier();
  }
  if (lane % ROW_LANES != 0u || row >= UNKNOWNS) return;
  float y = parts[0][lane];
#if RIGID_START
  for (int c = 0; c < 6; ++c) g[c] = parts[1 + c][lane];
  y += rigid_part(row, body, g);
#endif
  coarse_y[row] = is_free[row / 6u] * y;
}
