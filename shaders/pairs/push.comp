// The corrections of each contact, with masses split among the contacts of a vertex, so that momentum is kept. One invocation per record.
#include "pairs/pairs.glsl"
layout(std430, binding = BIND_POSITIONS) restrict readonly buffer Positions { Position positions[]; };
layout(std430, binding = BIND_VELOCITIES) restrict readonly buffer Velocities { Velocity velocities[]; };
#include "pairs/formulas.glsl"
#include "pairs/meeting.glsl"
const float push_most = EDGE / 10.0;  // m, in a substep: so bodies that are deep in each other leave each other
void add(uint i, uint at, vec3 correction) {
  ivec3 quanta = ivec3(round(clamp(correction, -params.body_size / PARTS, params.body_size / PARTS) * (params.inverse_quantum * PARTS)));
  for (uint c = 0u; c < 3u; ++c)
    if (quanta[c] != 0) atomicAdd(pair_sums[8u * i + at + c], quanta[c]);
}
void main() {
  uint record = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (record >= pair_lists[RECORDS]) return;
  uint k = RECORDS_AT + RECORD * record, s = pair_lists[k], t = pair_lists[k + 1u];
  if (t == NONE) return;
  uvec4 vertices = vertices_of(s, t & TARGET);
  Meeting m = meeting_of(s, t);
  vec3 way = vec3(0.0);
  float weight = 0.0;
  for (uint j = 0u; j < 4u; ++j) {
    way += m.weights[j] * params.h * velocities[vertices[j]].high;
    weight += m.weights[j] * m.weights[j] * positions[vertices[j]].inverse_mass * float(pair_sums[8u * vertices[j] + 3u]);
  }
  if (!(weight > 0.0)) return;
  Stop by = meeting_correction(m, way, push_most, params.friction);
  for (uint j = 0u; j < 4u; ++j) {
    if (m.weights[j] == 0.0) continue;
    float factor = m.weights[j] * positions[vertices[j]].inverse_mass / weight;
    add(vertices[j], 0u, factor * by.stopped);
    add(vertices[j], 4u, factor * by.pushed);
  }
}
