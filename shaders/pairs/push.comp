// The corrections of each contact, with masses split among the contacts of a vertex, so that momentum is kept. One invocation per record.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_VELOCITIES) restrict readonly buffer Velocities { Velocity velocities[]; };
#include "pairs/formulas.glsl"
const float push_speed = 0.5;  // sizes per second: how fast bodies leave each other that are deep in each other
void add(uint i, vec3 correction) {
  ivec3 quanta = ivec3(round(clamp(correction, -params.body_size / PARTS, params.body_size / PARTS) * (params.inverse_quantum * PARTS)));
  for (uint c = 0u; c < 3u; ++c) atomicAdd(pair_sums[4u * i + c], quanta[c]);
}
void main() {
  uint record = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (record >= pair_lists[RECORDS]) return;
  uint k = RECORDS_AT + RECORD * record, i = surface_vertex(pair_lists[k]), t = pair_lists[k + 1u];
  if (t == NONE) return;
  Pair own = Pair(positions[i].high, positions[i].low);
  float w = positions[i].inverse_mass, weight = w * float(pair_sums[4u * i + 3u]), weights[3];
  vec3 corners[3], way = params.h * velocities[i].high;
  Meeting m;
  uint corner[3];
  for (uint j = 0u; j < 3u; ++j) {
    corner[j] = triangle_vertex(t, j);
    Position p = positions[corner[j]];
    corners[j] = relative(Pair(p.high, p.low), own);
    weights[j] = p.inverse_mass;
  }
  m = meet(corners[0], corners[1], corners[2]);
  m.gap -= surface_thickness(pair_lists[k]);
  for (uint j = 0u; j < 3u; ++j) {
    way -= m.weights[j] * params.h * velocities[corner[j]].high;
    weight += m.weights[j] * m.weights[j] * weights[j] * float(pair_sums[4u * corner[j] + 3u]);
  }
  if (!(weight > 0.0)) return;
  vec3 lambda = meeting_correction(m, way, push_speed * params.body_size * params.h, params.friction) / weight;
  add(i, w * lambda);
  for (uint j = 0u; j < 3u; ++j)
    if (m.weights[j] > 0.0) add(corner[j], (-m.weights[j] * weights[j]) * lambda);
}
