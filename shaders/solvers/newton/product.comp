// A z, row by row, of smoothed tets after stresses.comp, and its dot products with r and z. LANES invocations per
// vertex; work-groups are of one body, of which the last to end adds the body's dot products up, in the order of the
// rows.
#define COLUMNS 1
#define WITHOUT_VELOCITIES
#include "solvers/newton/newton.glsl"
#if AVERAGED
#include "rings.glsl"
#endif
shared vec3 parts[GROUP_SIZE];
shared bool last;
void add_up(uint body, uint begin, uint end) {
  uint lane = gl_LocalInvocationIndex;
  memoryBarrierBuffer();
  vec2 sum = vec2(0.0);
  for (uint k = begin + lane; k < end; k += GROUP_SIZE) sum += group_dots[k];
  columns[0][lane] = vec4(sum, 0.0, 0.0);
  add_up_columns();
  if (lane == 0u) {
    dots[body] = columns[0][0].xy;
    products_done[body] = 0u;
  }
}

void main() {
  const uint rows = GROUP_SIZE / LANES;
  uint lane = gl_LocalInvocationIndex, group = group_index();
  if (group >= PRODUCT_GROUPS) return;
  uint body = BODIES == 1u ? 0u : group_bodies[group];
  BodyRange range = range_of(body);
  uint i = range.first + (group - range.first_group) * rows + lane / LANES;
  vec3 sum = vec3(0.0), own = vec3(0.0);
  if (i < range.end) {
    own = at(SEARCH, i).xyz;
    uint first = first_neighbour[i], end = first_neighbour[i + 1u];
#if AVERAGED
    Ring ring = ring_of(i);
    mat3 stress = MATRIX_OF(stresses, i);
    float pressure = stresses[3u * i].w;
#endif
    for (uint k = first + lane % LANES; k < end; k += LANES) {
      uint edge = neighbours[k].x, e = edge >> 1;
      vec3 c0 = blocks[e].columns[0].xyz, c1 = blocks[e].columns[1].xyz, c2 = blocks[e].columns[2].xyz;
      vec3 d = at(SEARCH, neighbours[k].y).xyz - own;
      sum += (edge & 1u) == 0u ? c0 * d.x + c1 * d.y + c2 * d.z : vec3(dot(c0, d), dot(c1, d), dot(c2, d));
#if AVERAGED
      if (!(ring.inverse_volume > 0.0)) continue;
      RingNeighbour n = ring_neighbour(ring.first_neighbour + 2u * (k - first));
      mat3 others = MATRIX_OF(stresses, n.vertex);
      sum += others * n.other - stress * n.own + slopes[edge ^ 1u].xyz * stresses[3u * n.vertex].w -
             slopes[edge].xyz * pressure;
#endif
    }
  }
  parts[lane] = sum;
  barrier();
  vec2 own_dots = vec2(0.0);
  if (lane % LANES == 0u && i < range.end) {
    for (uint k = 1u; k < LANES; ++k) sum += parts[lane + k];
    float inertia = at(AIM, i).w, slides = at(INVERSE, i).w;
    sum += inertia * own;
#if TOUCHING
    sum += taken_press(i);
#endif
    if (slides > 0.0)
      sum += slides * without(free_part(own, floatBitsToUint(at(INVERSE2, i).w), i), slip_direction(i));
    if (!(inertia > 0.0)) sum = vec3(0.0);
    put(PRODUCT, i, sum, 0.0);
    own_dots = vec2(dot(at(RESIDUAL, i).xyz, own), dot(sum, own));
  }
  columns[0][lane] = vec4(own_dots, 0.0, 0.0);
  add_up_columns();
  uint groups = (range.end - range.first + rows - 1u) / rows;
  if (lane == 0u) {
    group_dots[group] = columns[0][0].xy;
    memoryBarrierBuffer();
    last = atomicAdd(products_done[body], 1u) + 1u == groups;
  }
  barrier();
  if (last) add_up(body, range.first_group, range.first_group + groups);
}
