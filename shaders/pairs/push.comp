// The corrections of each contact, with masses split among the contacts of a vertex, so that momentum is kept. One invocation per record.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_VELOCITIES) restrict readonly buffer Velocities { Velocity velocities[]; };
#include "pairs/formulas.glsl"
const float push_most = CELL / 12.0;  // m, a tenth of a mean edge, in a substep: so bodies that are deep in each other leave each other
void add(uint i, uint at, vec3 correction) {
  ivec3 quanta = ivec3(round(clamp(correction, -params.body_size / PARTS, params.body_size / PARTS) * (params.inverse_quantum * PARTS)));
  for (uint c = 0u; c < 3u; ++c)
    if (quanta[c] != 0) atomicAdd(pair_sums[8u * i + at + c], quanta[c]);
}
void add(uint i, Stop by, float factor) {
  add(i, 0u, factor * by.stopped);
  add(i, 4u, factor * by.pushed);
}
void main() {
  uint record = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (record >= pair_lists[RECORDS]) return;
  uint k = RECORDS_AT + RECORD * record, i = surface_vertex(pair_lists[k]), t = pair_lists[k + 1u];
  if (t == NONE) return;
  Pair own = Pair(positions[i].high, positions[i].low);
  float w = positions[i].inverse_mass, weight = w * float(pair_sums[8u * i + 3u]), weights[3];
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
    weight += m.weights[j] * m.weights[j] * weights[j] * float(pair_sums[8u * corner[j] + 3u]);
  }
  if (!(weight > 0.0)) return;
  Stop by = meeting_correction(m, way, push_most, params.friction);
  add(i, by, w / weight);
  for (uint j = 0u; j < 3u; ++j)
    if (m.weights[j] > 0.0) add(corner[j], by, -m.weights[j] * weights[j] / weight);
}
